//! The late ticks of a traced run: the cause of each, and who had the core around it.

use crate::report::Report;
use crate::trace::{Kind, Outlier, TraceSection};
use maud::{Markup, html};
use std::collections::BTreeMap;
use stylet_report::parts::{Column, cell, count, micro, num, table};

/// Most intervals of a tick that are listed: the longest ones.
const LISTED: usize = 12;

pub fn causes(r: &Report) -> Markup {
    let Some(t) = &r.trace else {
        return Markup::default();
    };
    html! {
        h2 { "Late ticks and their causes" }
        @if let Some(why) = &t.absent {
            p { (why) }
        } @else {
            p class="faint" { (summary(t)) }
            @if !t.outliers.is_empty() { (totals(&t.outliers)) }
            section class="figures" {
                @for o in &t.outliers { (outlier(o)) }
            }
        }
    }
}

fn summary(t: &TraceSection) -> String {
    format!(
        "A tick is late from {} \u{b5}s on, wake-up and own work together. {} were late; {} of the latest have their trace here, {} have \
         none because the buffer was being read. {} events of the kernel, {} KiB for each core, read in at most {} ms, {} events lost.",
        num(t.over_us),
        num(t.late_ticks as f64),
        t.outliers.len(),
        num(t.untraced as f64),
        t.events.len(),
        num(t.buffer_kib_per_core as f64),
        num(t.longest_read_ms),
        num(t.lost_events as f64),
    )
}

/// Lists all causes by kind and name, the costliest first.
fn totals(outliers: &[Outlier]) -> Markup {
    let mut all: BTreeMap<(Kind, &str), (u32, f64, f64)> = BTreeMap::new();
    for c in outliers.iter().flat_map(|o| &o.causes) {
        let (ticks, sum_us, worst_us) = all.entry((c.kind, &c.who)).or_default();
        *ticks += 1;
        *sum_us += c.us;
        *worst_us = worst_us.max(c.us);
    }
    let mut all: Vec<_> = all.into_iter().collect();
    all.sort_by(|a, b| b.1.1.total_cmp(&a.1.1));
    let rows: Vec<Vec<Markup>> = all
        .iter()
        .map(|((kind, who), (ticks, sum_us, worst_us))| {
            vec![
                cell(kind.name()),
                cell(who),
                cell(ticks),
                count(*sum_us),
                count(*worst_us),
            ]
        })
        .collect();
    let head = ["cause", "who", "ticks", "\u{b5}s in all", "\u{b5}s at worst"];
    let columns = [
        Column::Text,
        Column::Wide,
        Column::Number,
        Column::Number,
        Column::Number,
    ];
    table(&head, &rows, &columns)
}

fn outlier(o: &Outlier) -> Markup {
    let counted: Vec<String> = o
        .counted
        .iter()
        .map(|c| format!("{} {}", c.what, num(c.times as f64)))
        .collect();
    html! {
        figure {
            figcaption {
                (format!("{:.3} s", o.at_s)) ", wake-up " (num(o.wake_us)) " \u{b5}s, work " (num(o.work_us)) " \u{b5}s"
            }
            (holders(o))
            p { (micro(&o.cause)) "." }
            @if !counted.is_empty() {
                p class="faint" { "Counted in the " (num(o.counted_over_ms)) " ms around it: " (counted.join(", ")) "." }
            }
        }
    }
}

/// Lists who had the core around the tick, in the order of time.
fn holders(o: &Outlier) -> Markup {
    let mut longest: Vec<f64> = o.trace.iter().map(|p| p.us).collect();
    longest.sort_by(|a, b| b.total_cmp(a));
    let least_us = longest.get(LISTED).copied().unwrap_or(0.0);
    let listed = o.trace.iter().filter(|p| p.us > least_us);
    let rows: Vec<_> = listed
        .map(|p| vec![count(p.from_us.round()), count(p.us), cell(&p.who)])
        .collect();
    table(
        &["from due, \u{b5}s", "for, \u{b5}s", "had the core"],
        &rows,
        &[Column::Number, Column::Number],
    )
}
