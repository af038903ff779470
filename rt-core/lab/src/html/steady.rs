//! Steadiness of the run.

use super::times::time_table;
use crate::report::Report;
use crate::stationary::{LEVEL, TestResult};
use maud::{Markup, html};
use stylet_report::parts::{Column, cell, num, table};

pub fn steady(r: &Report) -> Markup {
    let s = &r.stationarity;
    let row = |t: &TestResult| {
        let met = html! { @if t.rejects() { b { "no" } } @else { "yes" } };
        vec![
            cell(&t.name),
            cell(format!("{:.3}", t.distance)),
            cell(format!("{:.1e}", t.p)),
            met,
        ]
    };
    let rows: Vec<_> = s.tests.iter().map(row).collect();
    let head = ["Kolmogorov-Smirnov test", "distance", "p", "may be the same"];
    html! {
        h2 { "How steady the run was" }
        (time_table(&r.parts))
        @if !rows.is_empty() { (table(&head, &rows, &[Column::Text, Column::Number, Column::Number])) }
        @if s.against.is_empty() {
            p { "No change was found: the wake-ups of all parts may be of one distribution." }
        } @else {
            p { "The figures hold for this run alone, because:" }
            ul { @for reason in &s.against { li { (reason) } } }
        }
        p class="faint" {
            "Tests on " (num(s.values as f64)) " wake-ups of the force loop, " (num(s.every as f64)) " ticks apart"
            @if s.independent { ", where they no longer depend on each other" }
            ". A p below " (LEVEL) " counts as a change. Nothing is extrapolated to longer runs."
        }
    }
}
