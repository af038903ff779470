//! Steadiness of the run, and the lateness to expect in a longer one.

use super::times::time_table;
use crate::extreme::{Extremes, Tail};
use crate::report::Report;
use crate::stationary::LEVEL;
use maud::{Markup, html};
use stylet_report::parts::{Column, cell, duration, num, or_na, table};

pub fn steady(r: &Report) -> Markup {
    let s = &r.extremes.stationarity;
    let tests = s.tests.iter().chain(&r.extremes.tests_of_the_tail);
    let rows: Vec<Vec<Markup>> = tests
        .map(|t| {
            let met = html! { @if t.rejects() { b { "no" } } @else { "yes" } };
            vec![
                cell(t.name),
                cell(format!("{:.3}", t.distance)),
                cell(format!("{:.1e}", t.p)),
                met,
            ]
        })
        .collect();
    html! {
        h2 { "How steady the run was" }
        (time_table(&r.parts))
        @if !rows.is_empty() {
            (table(&["Kolmogorov-Smirnov test", "distance", "p", "may be the same"], &rows, &COLUMNS))
        }
        p class="faint" {
            "Tests on " (num(s.values as f64)) " wake-ups of the force loop, " (num(s.every as f64)) " ticks apart"
            @if s.independent { ", where they no longer depend on each other" }
            ". A p below " (LEVEL) " counts as a change."
        }
        (levels(&r.extremes))
    }
}

const COLUMNS: [Column; 4] = [Column::Text, Column::Number, Column::Number, Column::Text];

fn levels(e: &Extremes) -> Markup {
    html! {
        h2 { "Wake-ups later than any seen" }
        @if e.levels.is_empty() {
            p { "Not applicable, because:" }
            ul { @for reason in &e.not_applicable_because { li { (reason) } } }
        } @else {
            @let rows: Vec<Vec<Markup>> = e.levels.iter().map(|l| vec![
                cell(duration(l.every_s)),
                or_na(Some(l.us)),
                cell(format!("{} to {}", num(l.interval_us[0]), num(l.interval_us[1]))),
            ]).collect();
            div class="half" {
                (table(&["exceeded once in", "wake-up, \u{b5}s", "95 % interval, \u{b5}s"], &rows, &[Column::Text, Column::Number, Column::Number]))
            }
        }
        @if let Some(tail) = &e.tail { (fit(tail)) }
    }
}

fn fit(t: &Tail) -> Markup {
    html! {
        p class="faint" {
            "Generalised Pareto distribution of " (t.clusters) " clusters (" (t.exceedances) " wake-ups later than "
            (num(t.threshold_us)) " \u{b5}s, extremal index " (num(t.extremal_index)) ", Ferro and Segers 2003): scale "
            (num(t.scale_us)) " \u{b5}s, shape " (format!("{:.2}", t.shape)) ". Anderson-Darling "
            (format!("{:.2}", t.anderson_darling)) ", at most " (format!("{:.2}", t.anderson_darling_5_percent))
            " at 5 % (Choulakian and Stephens 2001). Intervals by profile likelihood. A level holds for a machine that stays as it was."
        }
    }
}
