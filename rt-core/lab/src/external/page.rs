//! The page of a capture: agreement of both clocks, and each delay with its uncertainty budget.

use super::External;
use super::budget::Delay;
use maud::{Markup, html};
use stylet_report::parts::{Column, cell, micro, num, table};

/// Returns the whole page, which is self-contained.
pub fn page(e: &External) -> String {
    let [p50, p99, most] = e.due_to_pin_us;
    let rows = [
        (
            "edges that are toggles of this run",
            format!("{} of {} edges, {} toggles", e.pairs, e.edges, e.toggles),
        ),
        (
            "the instrument's clock is faster by, ppm",
            format!("{:.3} \u{b1} {:.3} (k = 2)", e.drift_ppm, e.drift_expanded_ppm),
        ),
        (
            "edges beside our record, standard deviation, \u{b5}s",
            num(e.pin_deviation_us),
        ),
        ("edges beside our record, worst, \u{b5}s", num(e.pin_worst_us)),
        ("writing the pin took at most, \u{b5}s", num(e.pin_write_worst_us)),
        (
            "due to pin, p50, p99 and latest, \u{b5}s",
            format!("{}, {}, {}", num(p50), num(p99), num(most)),
        ),
        ("sample of the instrument, \u{b5}s", num(e.sample_us)),
    ];
    let rows: Vec<Vec<Markup>> = rows
        .into_iter()
        .map(|(what, value)| vec![cell(what), cell(value)])
        .collect();
    let main = html! {
        header { h1 { "Capture of an instrument" } }
        p class="sub" { code { (e.capture) } "." }
        h2 { "Agreement with our clock" }
        div class="half" { (table(&["", ""], &rows, &[Column::Text, Column::Number])) }
        @for d in &e.delays { (delay(d)) }
        @for why in &e.without { p { "No delay: " (why) "." } }
        footer {
            "Uncertainties after the GUM (NIST TN 1297): each term is a standard uncertainty, the expanded one has a coverage \
             factor of 2, about 95 %. What happens between the register and the plug, and the time that an edge takes, are in no term: look them \
             up for the port and the comparator."
        }
    };
    stylet_report::page("Capture of an instrument", "", &main)
}

fn delay(d: &Delay) -> Markup {
    let mut rows: Vec<Vec<Markup>> = d
        .terms
        .iter()
        .map(|t| vec![cell(t.name), cell(t.kind), cell(num(t.us)), cell(micro(&t.why))])
        .collect();
    rows.push(vec![
        html! { b { "combined" } },
        cell(""),
        html! { b { (num(d.combined_us)) } },
        cell("root of the sum of squares"),
    ]);
    rows.push(vec![
        html! { b { "expanded" } },
        cell(""),
        html! { b { (num(d.expanded_us)) } },
        cell("k = 2"),
    ]);
    let columns = [Column::Text, Column::Text, Column::Number, Column::Wide];
    html! {
        h2 { "From " (d.from) " to " (d.channel) }
        p {
            b { (format!("{:.1} \u{b1} {:.1} \u{b5}s", d.mean_us, d.expanded_us)) } " (mean of " (d.pairs) ", between "
            (num(d.least_us)) " and " (num(d.most_us)) " \u{b5}s)"
        }
        (table(&["term", "type", "\u{b5}s", "why"], &rows, &columns))
    }
}
