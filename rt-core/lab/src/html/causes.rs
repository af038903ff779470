//! The late ticks of a traced run: the cause of each, with a small picture of the trace around it.

use crate::report::Report;
use crate::trace::{Kind, Lane, Outlier, TracePiece, TraceSection};
use maud::{Markup, html};
use std::collections::BTreeMap;
use stylet_report::parts::{Column, cell, count, micro, num, table};

/// Size of a picture in its own units; the page scales it.
const WIDTH: f64 = 520.0;
const LEFT: f64 = 74.0;
const LANE: f64 = 18.0;
const TOP: f64 = 18.0;
const LANES: [(Lane, &str, &str); 4] = [
    (Lane::Loop, "force loop", "#0072b2"),
    (Lane::Threads, "threads", "#d55e00"),
    (Lane::Interrupts, "interrupts", "#b3362b"),
    (Lane::Idle, "idle", "#b9c2ca"),
];
/// Smallest width of a piece that shows its name.
const NAMED: f64 = 60.0;
/// Width of a letter of the pictures.
const LETTER: f64 = 5.4;

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
            (picture(o))
            p { (micro(&o.cause)) "." }
            @if !counted.is_empty() {
                p class="faint" { "Counted in the " (num(o.counted_over_ms)) " ms around it: " (counted.join(", ")) "." }
            }
        }
    }
}

fn picture(o: &Outlier) -> Markup {
    let (Some(first), Some(last)) = (o.trace.first(), o.trace.last()) else {
        return Markup::default();
    };
    let (from_us, span_us) = (first.from_us, (last.from_us + last.us - first.from_us).max(1.0));
    let x = |us: f64| LEFT + (us - from_us) / span_us * (WIDTH - LEFT - 4.0);
    let bottom = TOP + LANE * LANES.len() as f64;
    let mark = |us: f64, what: &str, end: bool| {
        let anchor = if end { "end" } else { "start" };
        let place = x(us) + if end { -3.0 } else { 3.0 };
        html! {
            line x1=(fixed(x(us))) x2=(fixed(x(us))) y1="4" y2=(fixed(bottom)) stroke="#333d47" stroke-width="1" stroke-dasharray="3 2" {}
            text x=(fixed(place)) y="12" text-anchor=(anchor) font-size="10" fill="#333d47" { (what) }
        }
    };
    // Both names are outside the interval between them, so that they do not overlap.
    html! {
        svg viewBox={ "0 0 " (WIDTH) " " (bottom + 16.0) } xmlns="http://www.w3.org/2000/svg" font-family="system-ui, sans-serif" role="img"
            aria-label={ "Trace around the tick: " (o.cause) } {
            @for (i, (lane, name, color)) in LANES.iter().enumerate() {
                @let y = TOP + LANE * i as f64;
                text x=(fixed(LEFT - 6.0)) y=(fixed(y + 12.5)) text-anchor="end" font-size="10" fill="#333d47" { (name) }
                @for p in o.trace.iter().filter(|p| p.lane == *lane) { (piece(p, x(p.from_us), x(p.from_us + p.us), y, color)) }
            }
            line x1=(fixed(LEFT)) x2=(fixed(WIDTH - 4.0)) y1=(fixed(bottom)) y2=(fixed(bottom)) stroke="#c9d0d6" {}
            (mark(0.0, "due", true))
            (mark(o.wake_us, "woke", false))
            text x=(fixed(WIDTH - 4.0)) y=(fixed(bottom + 12.0)) text-anchor="end" font-size="10" fill="#333d47" {
                (num(span_us)) " \u{b5}s in all"
            }
        }
    }
}

fn piece(p: &TracePiece, from: f64, to: f64, y: f64, color: &str) -> Markup {
    let width = (to - from).max(0.6);
    let fits = p.lane != Lane::Loop && p.lane != Lane::Idle && width >= NAMED;
    let letters = ((width - 6.0) / LETTER).max(0.0) as usize;
    let name: String = p.who.chars().take(letters).collect();
    html! {
        rect x=(fixed(from)) y=(fixed(y + 2.0)) width=(fixed(width)) height=(fixed(LANE - 4.0)) fill=(color) {
            title { (p.who) ", " (num(p.us)) " \u{b5}s" }
        }
        @if fits { text x=(fixed(from + 3.0)) y=(fixed(y + 12.5)) font-size="10" fill="#ffffff" { (name) } }
    }
}

fn fixed(value: f64) -> String {
    format!("{value:.1}")
}
