//! The page of a change: the changed settings, and the wake-ups of the force loop before and after.

use super::MendReport;
use super::file::State;
use crate::html::times::time_table;
use crate::plots::{self, BLUE, DrawError, ORANGE, Series};
use crate::summary::Summary;
use maud::{Markup, PreEscaped, html};
use stylet_report::parts::{Column, cell, num, or_na, table};

/// Returns the name of each percentile, and after over before.
pub fn ratios(before: &Summary, after: &Summary) -> Vec<(&'static str, String)> {
    let said = |ratio: Option<f64>| ratio.map_or("n/a".to_owned(), |r| format!("{r:.2}"));
    let of = |s: &Summary, name: &str| s.quantile(name).and_then(|q| q.us);
    let names = before.quantiles.iter().map(|q| q.name);
    let mut all: Vec<_> = names
        .map(|name| (name, said(of(after, name).zip(of(before, name)).map(|(a, b)| a / b))))
        .collect();
    all.push(("max", said(after.max_us.zip(before.max_us).map(|(a, b)| a / b))));
    all
}

/// Returns the whole page, which is self-contained.
pub fn page(r: &MendReport) -> Result<String, DrawError> {
    let series = |name, color, histogram| Series { name, color, histogram };
    let both = [
        series("before", ORANGE, &r.before.wake_times),
        series("after", BLUE, &r.after.wake_times),
    ];
    let (wake, tail) = (plots::wake_histogram(&both)?, plots::tail(&both)?);
    let main = html! {
        header { h1 { "Settings changed" } }
        p class="sub" {
            "Force loop on core " (r.core) ", measured for " (num(r.measured_for_s)) " s before and again after. " (r.made_at) ", "
            (r.program) "."
        }
        h2 { "Settings" }
        (changes(r))
        h2 { "Before" }
        (time_table(&[r.before.wake.clone(), r.before.work.clone()]))
        h2 { "After" }
        (time_table(&[r.after.wake.clone(), r.after.work.clone()]))
        (compared(r))
        h2 { "Pictures" }
        section class="figures" {
            figure { figcaption { "Wake-up of the force loop" } (PreEscaped(wake)) }
            figure { figcaption { "Cumulative tail" } (PreEscaped(tail)) }
        }
        footer {
            "One measurement before and one after: a PC that was busy with something else in one of them shows a difference \
             that no setting made. A restart undoes every setting; so does " code { "rt-core doctor --undo" } "."
        }
    };
    Ok(stylet_report::page(
        &format!("Settings changed, {}", r.made_at),
        "",
        &main,
    ))
}

fn changes(r: &MendReport) -> Markup {
    let rows: Vec<Vec<Markup>> = r
        .changes
        .changes
        .iter()
        .map(|c| {
            let state = match &c.state {
                State::Refused(why) => html! { b { "refused: " } (why) },
                State::Applied => cell("changed"),
                other => cell(format!("{other:?}")),
            };
            vec![
                cell(&c.check),
                html! { code { "/" (c.path) } },
                cell(&c.before),
                cell(&c.after),
                state,
            ]
        })
        .collect();
    if rows.is_empty() {
        return html! { p { "Every setting was as it should be: nothing was changed." } };
    }
    let columns = [Column::Text, Column::Text, Column::Text, Column::Text, Column::Wide];
    table(&["check", "setting", "before", "after", ""], &rows, &columns)
}

fn compared(r: &MendReport) -> Markup {
    let ratios = ratios(&r.before.wake, &r.after.wake);
    let head: Vec<&str> = ratios.iter().map(|(name, _)| *name).collect();
    let row: Vec<Markup> = ratios.iter().map(|(_, ratio)| cell(ratio)).collect();
    let missed = |s: &super::Side| {
        let of = s.ticks + s.missed_deadlines;
        html! { (num(s.missed_deadlines as f64)) " of " (or_na(Some(of as f64))) }
    };
    html! {
        h2 { "After over before" }
        div class="half" { (table(&head, &[row], &vec![Column::Number; head.len()])) }
        p class="faint" { "Deadlines missed: " (missed(&r.before)) " before, " (missed(&r.after)) " after." }
    }
}
