//! The page over all reports.

use super::Pc;
use super::change::{self, Change, Growth};
use super::entry::{Entry, Percentile};
use crate::html::badge;
use crate::plots::{self, DrawError, TrendPoint};
use crate::saved::NotCounted;
use crate::verdict::Outcome;
use maud::{Markup, PreEscaped, html};
use stylet_report::parts::{Column, cards, cell, num, or_na, table};

/// Returns the whole page, which is self-contained.
pub fn page(pcs: &[Pc], unread: &[NotCounted]) -> Result<String, DrawError> {
    let trends = trends(pcs)?;
    let growths: Vec<(&Pc, Growth)> = pcs
        .iter()
        .flat_map(|pc| change::growths(pc).into_iter().map(move |g| (pc, g)))
        .collect();
    let reports: usize = pcs.iter().map(|pc| pc.entries.len()).sum();
    let times = || {
        pcs.iter()
            .flat_map(|pc| pc.entries.iter().map(|e| e.report.made_at.as_str()))
    };
    let heading = format!("Latency of {}", counted(pcs.len(), "PC", "PCs"));
    let main = html! {
        header { h1 { (heading) } }
        p class="sub" {
            (counted(reports, "report", "reports")) ", " (times().min().unwrap_or_default()) " to " (times().max().unwrap_or_default())
            ". Times are wake-up latencies of the force loop."
        }
        (counts(pcs, growths.len()))
        h2 { "Latest report of each PC" }
        (overview(pcs))
        h2 { "Trend of each PC" }
        (trends)
        (grown(&growths))
        (not_counted(unread))
        footer {
            "A tail counts as grown where p99.9 (else p99) is more than 1.25 times that of the previous report of the same PC, \
             scene, load, rate and spin, and the 95 % intervals lie apart. A change beside it is not yet its cause. All \
             reports as a table: fleet.csv."
        }
    };
    Ok(stylet_report::page(&heading, "", &main))
}

/// Returns a count with its noun.
pub(super) fn counted(count: usize, one: &str, more: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { more })
}

fn counts(pcs: &[Pc], grown: usize) -> Markup {
    let with = |outcome| pcs.iter().filter(|pc| pc.latest().outcome() == outcome).count();
    let all = [
        ("PC passes", "PCs pass", with(Outcome::Pass)),
        ("PC fails", "PCs fail", with(Outcome::Fail)),
        (
            "PC open",
            "PCs open",
            with(Outcome::NotMeasurable) + with(Outcome::Undecided),
        ),
        ("tail grew", "tails grew", grown),
    ];
    cards(all.map(|(one, more, count)| (html! { b { (count) } }, cell(if count == 1 { one } else { more }))))
}

fn overview(pcs: &[Pc]) -> Markup {
    let us = |e: &Entry, name: &str| or_na(e.percentile(name).map(|p| p.us));
    let row = |pc: &Pc| {
        let e = pc.latest();
        let kernel = e.machine.get("Kernel: version").map_or("", |v| kernel_release(v));
        vec![
            badge(e.outcome()),
            html! { b { (pc.name) } br; span class="faint" { (e.report.made_at) br; (e.report.notes.join("; ")) } },
            us(e, "p50"),
            us(e, "p99"),
            us(e, "p99.9"),
            or_na(e.max_us()),
            cell(e.report.haptic.counts.missed_deadlines),
            html! { (e.protocol.replace(" us", " \u{b5}s")) br; span class="faint" { (kernel) } },
            cell(e.failed().join(", ")),
        ]
    };
    let mut sorted: Vec<&Pc> = pcs.iter().collect();
    // Urgent entries first.
    sorted.sort_by_key(|pc| std::cmp::Reverse(pc.latest().outcome()));
    let rows: Vec<Vec<Markup>> = sorted.into_iter().map(row).collect();
    let head = [
        "outcome",
        "PC",
        "p50, \u{b5}s",
        "p99, \u{b5}s",
        "p99.9, \u{b5}s",
        "max, \u{b5}s",
        "missed",
        "measured with",
        "limits not met",
    ];
    let n = Column::Number;
    table(
        &head,
        &rows,
        &[Column::Text, Column::Text, n, n, n, n, n, Column::Text, Column::Wide],
    )
}

/// Returns the third word of `Linux version 6.1.0-rt (builder) ...`.
fn kernel_release(version: &str) -> &str {
    version.split_whitespace().nth(2).unwrap_or(version)
}

/// Draws one picture for each PC with two reports or more of one protocol.
fn trends(pcs: &[Pc]) -> Result<Markup, DrawError> {
    let (mut lines, mut single) = (Vec::new(), Vec::new());
    for pc in pcs {
        let protocol = &pc.latest().protocol;
        let same: Vec<&Entry> = pc.entries.iter().filter(|e| e.protocol == *protocol).collect();
        if same.len() < 2 {
            single.push(pc.name.as_str());
            continue;
        }
        // Short runs have no p99.9; a line shows a single percentile.
        let long = same.iter().all(|e| e.percentile("p99.9").is_some());
        let tail = if long { "p99.9" } else { "p99" };
        let points: Vec<TrendPoint> = same.iter().map(|e| point(e, e.percentile(tail))).collect();
        lines.push((pc.name.as_str(), protocol.replace(" us", " \u{b5}s"), tail, points));
    }
    let range_us = plots::trend_range_us(lines.iter().flat_map(|line| &line.3));
    let mut figures = Vec::new();
    for (name, protocol, tail, points) in &lines {
        figures.push((name, protocol, plots::trend(points, tail, range_us)?));
    }
    Ok(html! {
        section class="figures three" {
            @for (name, protocol, svg) in figures {
                figure { figcaption { (name) br; span class="faint" { (protocol) } } (PreEscaped(svg)) }
            }
        }
        p class="faint" { "A full point is a report that passed, a bar the 95 % interval. All pictures have one scale." }
        @if !single.is_empty() { p class="faint" { "One report alone: " (single.join(", ")) "." } }
    })
}

fn point(e: &Entry, tail: Option<Percentile>) -> TrendPoint {
    let time = jiff::civil::DateTime::strptime("%Y-%m-%d %H:%M:%S UTC", &e.report.made_at).ok();
    let seconds = time
        .and_then(|t| t.to_zoned(jiff::tz::TimeZone::UTC).ok())
        .map_or(0, |t| t.timestamp().as_second());
    TrendPoint {
        time_s: seconds as f64,
        p50_us: e.percentile("p50").map(|p| p.us),
        tail_us: tail.map(|p| p.us),
        interval_us: tail.and_then(|p| p.interval_us),
        passed: e.outcome() == Outcome::Pass,
    }
}

fn grown(growths: &[(&Pc, Growth)]) -> Markup {
    let row = |(pc, g): &(&Pc, Growth)| {
        vec![
            html! { b { (pc.name) } br; span class="faint" { (g.before.report.made_at) br; (g.after.report.made_at) } },
            cell(g.percentile),
            cell(format!("{} to {}", num(g.from_us), num(g.to_us))),
            changes(&g.changes),
        ]
    };
    let rows: Vec<Vec<Markup>> = growths.iter().map(row).collect();
    html! {
        h2 { "Tails that grew, and what changed with them" }
        @if rows.is_empty() {
            p { "No tail grew from one report to the next." }
        } @else {
            (table(&["PC, between", "of", "\u{b5}s", "what changed"], &rows, &[Column::Text, Column::Text, Column::Number, Column::Wide]))
        }
    }
}

fn changes(all: &[Change]) -> Markup {
    let shown = |value: &Option<String>| value.clone().unwrap_or_else(|| "not reported".to_owned());
    html! {
        @if all.is_empty() { "Nothing that the reports record: look at what else runs on the PC, its load and its temperature." }
        @for change in all {
            div { b { (change.what) } ": " (shown(&change.before)) " \u{2192} " (shown(&change.after)) }
        }
    }
}

fn not_counted(unread: &[NotCounted]) -> Markup {
    html! {
        @if !unread.is_empty() {
            h2 { "Files that are not counted" }
            ul { @for u in unread { li { code { (u.path) } ": " (u.why) } } }
        }
    }
}
