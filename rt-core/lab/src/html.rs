//! The report of a measurement as one page.

mod causes;
mod machine;
mod steady;
pub mod times;

use crate::cyclictest;
use crate::plots::{self, BLUE, DrawError, Limit, ORANGE, Series};
use crate::raw::Raw;
use crate::report::{CYCLICTEST, HISTOGRAMS, OSADL, Report};
use crate::verdict::{LimitResult, Outcome};
use crate::whose::Whose;
use maud::{Markup, PreEscaped, html};
use stylet_report::parts::{Column, cards, cell, micro, num, or_na, table};

/// Returns the whole page. It has the digest of the raw data; the report has that of the page.
pub fn page(report: &Report, raw: &Raw) -> Result<String, DrawError> {
    let pictures = pictures(report, raw)?;
    let digest = report
        .files
        .iter()
        .find(|f| f.name == HISTOGRAMS)
        .map_or("", |f| &f.sha256);
    let main = html! {
        (header(report))
        (key_figures(report))
        h2 { "Limits" }
        (limits(&report.verdict.limits))
        (pictures)
        (times::of_loop("Force loop", &report.haptic))
        (times::of_loop("Tissue loop", &report.tissue))
        @if let Some(second) = &report.second {
            (times::of_loop("Loop of the second device", second))
        }
        (times::host(report))
        (times::comparison(report))
        (times::paired(report))
        (times::spin(report))
        (machine::stiffness(report))
        (machine::counters(report))
        (times::late(report))
        (times::noise(report))
        (causes::causes(report))
        (steady::steady(report))
        (machine::provenance(report))
        (machine::method(report))
        footer {
            "SHA-256 of " (HISTOGRAMS) ": " code { (digest) } ". Check with " code { "rt-core verify" } "."
        }
    };
    Ok(stylet_report::page(
        &format!("Latency report, {}", report.made_at),
        "",
        &main,
    ))
}

fn header(r: &Report) -> Markup {
    let p = &r.protocol;
    html! {
        header { h1 { "Latency report" } (badge(r.verdict.overall)) }
        p class="sub" {
            "Scene " b { (p.scene) } ", force loop at " b { (num(p.rate_hz)) " Hz" } ", tissue at " (num(p.tissue_rate_hz))
            " Hz, " @if let Some(hz) = p.second_rate_hz { "second device at " (num(hz)) " Hz, " } "load " b { (p.load.name()) } " (" (p.load_is) "), " b { (num(p.measured_s.round())) " s" } " measured of " (num(p.duration_s)) " s asked for, spin " (p.spin_us) " \u{b5}s, "
            (p.insertions) " insertions; " (micro(&r.others.words())) ". " (r.made_at) ", " (r.program) "."
        }
        @if let Some(whose) = whose(&r.whose) { p class="sub" { (whose) } }
        @if let Some(nonce) = &r.nonce { p class="sub" { "Answers the challenge " code { (nonce) } "." } }
        @if r.environment.qualified {
            p class="note" { "Environment qualified: no reason was found to doubt the tail." }
        } @else {
            div class="warning" {
                strong { "Environment not qualified." }
                " Percentiles above p99.5, maxima and missed deadlines are shown but not compared with their limits: here they \
                 say more about the machine below than about this program."
                ul { @for reason in &r.environment.evidence { li { (micro(reason)) } } }
            }
        }
    }
}

/// Returns operator, site and device, as far as given.
pub fn whose(w: &Whose) -> Option<String> {
    let serial = w.device_serial.as_ref().map(|s| format!("device {s}"));
    let named: Vec<String> = [w.operator.clone(), w.site.clone(), serial]
        .into_iter()
        .flatten()
        .collect();
    (!named.is_empty()).then(|| format!("{}.", named.join(", ")))
}

fn key_figures(r: &Report) -> Markup {
    let of = |name: &str, q: &str| {
        let summary = r.haptic.times.iter().find(|t| t.name == name);
        or_na(summary.and_then(|s| s.quantile(q)).and_then(|q| q.us))
    };
    let share = r.haptic.work_p999_of_period.map(|s| s * 100.0);
    let margin = r.stiffness.margins.iter().find(|m| m.at == "p99.9");
    let k = margin.and_then(|m| m.k_max_n_per_m);
    let figures = [
        ("wake-up, p50", of("wake-up", "p50"), "\u{b5}s"),
        ("wake-up, p99", of("wake-up", "p99"), "\u{b5}s"),
        ("own work, p99.9", of("whole tick", "p99.9"), "\u{b5}s"),
        ("of the period", or_na(share), "%"),
        ("missed deadlines", cell(r.haptic.counts.missed_deadlines), ""),
        ("stiffness margin, p99.9", or_na(k.map(|k| k / 1e3)), "N/mm"),
    ];
    cards(figures.map(|(what, value, unit)| (html! { b { (value) } " " (unit) }, cell(what))))
}

/// The outcome of a verdict or of one limit.
pub fn badge(outcome: Outcome) -> Markup {
    let class = match outcome {
        Outcome::Pass => "pass",
        Outcome::Fail => "fail",
        Outcome::NotMeasurable | Outcome::Undecided => "open",
    };
    html! { span class={ "badge " (class) } { (outcome.words()) } }
}

/// Tabulates outcomes, each with its evidence.
pub fn limits(all: &[LimitResult]) -> Markup {
    let row = |j: &LimitResult| {
        let sign = if j.lower_bound { "\u{2265}" } else { "\u{2264}" };
        vec![
            badge(j.outcome),
            html! { code { (j.name) } br; span class="faint" { (j.id) } },
            or_na(j.value),
            cell(format!("{sign} {}", num(j.limit))),
            cell(j.unit.replace("us", "\u{b5}s")),
            html! { (j.reason) br; span class="faint" { (micro(&j.evidence)) } },
        ]
    };
    let rows: Vec<Vec<Markup>> = all.iter().map(row).collect();
    let head = ["outcome", "limit", "value", "allowed", "unit", "reason and evidence"];
    let columns = [
        Column::Text,
        Column::Text,
        Column::Number,
        Column::Number,
        Column::Text,
        Column::Wide,
    ];
    table(&head, &rows, &columns)
}

fn pictures(r: &Report, raw: &Raw) -> Result<Markup, DrawError> {
    let series = |name, color, histogram| Series {
        name,
        color,
        histogram,
        limits: Vec::new(),
    };
    let [wake, work] = ["haptic/wake", "haptic/work"].map(|name| raw.get(name));
    let limited = |name, color, histogram, of| Series {
        limits: limits_of(r, of),
        ..series(name, color, histogram)
    };
    let force = || limited("force loop", BLUE, &wake, "wake");
    let own = limited("own work", ORANGE, &work, "work");
    let worst_us = force().limits.iter().find(|l| l.share == 0.0).map_or(0.0, |l| l.us);
    let mut figures = vec![
        ("Wake-up of the force loop", plots::wake_histogram(&[force()])?),
        ("Where a force tick goes", stages(raw, "haptic")?),
        (
            "Worst of each window",
            plots::windows(&r.windows, r.protocol.window_s, worst_us)?,
        ),
        ("Cumulative tail", plots::tail(&[force(), own])?),
        ("Where a tissue tick goes", stages(raw, "tissue")?),
    ];
    if let Some(c) = r.comparison.as_ref().filter(|c| !c.rounds.is_empty()) {
        let [ours, others] = ["comparison/ours", "comparison/other"].map(|name| raw.get(name));
        let turns = [
            series("force loop", BLUE, &ours),
            series(c.against.name(), ORANGE, &others),
        ];
        figures.push(("Wake-up on both sides, all turns", plots::wake_histogram(&turns)?));
    } else {
        let [seen, answered] = ["host/tip_to_host", "tissue/path"].map(|name| raw.get(name));
        let seen = series("tip moved to host saw it", BLUE, &seen);
        let answered = series("tip moved to tissue answered", ORANGE, &answered);
        figures.push(("From tip to tissue and host", plots::tail(&[seen, answered])?));
    }
    Ok(html! {
        h2 { "Pictures" }
        section class="figures" {
            @for (title, svg) in figures {
                figure { figcaption { (title) } (PreEscaped(svg)) }
            }
        }
        h2 { "Wake-ups of every measured core" }
        figure { (PreEscaped(osadl(r, raw)?)) }
        p class="faint" {
            "In the form of OSADL's latency plots: a step for each microsecond. From 1 ms on a histogram's bin is wider than a \
             step, 0.1 % of the time. The same counts are in " code { (CYCLICTEST) } ", in the layout of "
            code { "cyclictest --json" } ", and the picture is " code { (OSADL) } "."
        }
    })
}

/// Plots the wake-ups of every measured core as OSADL does.
pub fn osadl(r: &Report, raw: &Raw) -> Result<String, DrawError> {
    let missed = r.haptic.counts.missed_deadlines;
    plots::osadl(&cyclictest::cores(r, raw), &limits_of(r, "wake"), missed)
}

/// Returns the limits of a time of the force loop.
fn limits_of(r: &Report, of: &str) -> Vec<Limit> {
    let all = r.verdict.limits.iter();
    let limit = |l: &LimitResult| {
        let at = l.name.strip_prefix(of)?.strip_prefix('_')?.strip_suffix("_us")?;
        let shares = [("p50", 0.5), ("p99", 0.01), ("p99.9", 0.001), ("max", 0.0)];
        let (name, share) = shares.into_iter().find(|(name, _)| name.replace('.', "") == at)?;
        Some(Limit {
            name,
            share,
            us: l.limit,
        })
    };
    all.filter_map(limit).collect()
}

/// Plots the stages of a loop's tick: everything between jitter and work.
fn stages(raw: &Raw, name: &str) -> Result<String, DrawError> {
    let whole = ["wake", "jitter", "path", "due_to_output", "recording"];
    let rows: Vec<_> = raw
        .of_loop(name)
        .filter(|tag| !whole.contains(tag))
        .map(|tag| {
            let title = if tag == "work" {
                "whole tick".to_owned()
            } else {
                tag.replace('_', " ")
            };
            (title, raw.get(&format!("{name}/{tag}")))
        })
        .collect();
    plots::stages(&rows)
}
