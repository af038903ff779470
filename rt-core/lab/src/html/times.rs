//! Durations: loops, host, comparison, latest wake-ups.

use crate::compare::Against;
use crate::noise::NoiseGap;
use crate::report::{LoopSection, Report};
use crate::summary::{QUANTILES, Quantile, Summary};
use maud::{Markup, html};
use stylet_report::parts::{Column, cell, count, duration, micro, num, or_na, table};

pub fn of_loop(title: &str, section: &LoopSection) -> Markup {
    html! {
        h2 { (title) }
        (time_table(&section.times))
    }
}

pub fn time_table(times: &[Summary]) -> Markup {
    let mut head = vec!["microseconds", "min", "mean"];
    head.extend(QUANTILES.iter().map(|(name, _)| *name));
    head.extend(["max", "samples"]);
    let row = |s: &Summary| {
        let mut cells = vec![cell(&s.name), or_na(s.min_us), or_na(s.mean_us)];
        cells.extend(s.quantiles.iter().map(percentile));
        cells.extend([or_na(s.max_us), count(s.count as f64)]);
        cells
    };
    let rows: Vec<Vec<Markup>> = times.iter().map(row).collect();
    let mut columns = vec![Column::Number; head.len()];
    columns[0] = Column::Text;
    let mut needs: Vec<String> = Vec::new();
    for q in times.iter().flat_map(|t| &t.quantiles) {
        let reason = q.needs_s.map(|s| format!("{} needs a run of {}", q.name, duration(s)));
        needs.extend(reason.filter(|reason| !needs.contains(reason)));
    }
    html! {
        (table(&head, &rows, &columns))
        @if !needs.is_empty() {
            p class="faint" { "n/a: " (needs.join(", ")) "." }
        }
    }
}

/// Returns a percentile with its interval below it.
fn percentile(q: &Quantile) -> Markup {
    html! {
        (or_na(q.us))
        @if let Some([low, high]) = q.interval_us { br; span class="faint" { (num(low)) "\u{2013}" (num(high)) } }
    }
}

pub fn host(r: &Report) -> Markup {
    html! {
        h2 { "Host" }
        (time_table(&r.host.times))
        p class="faint" {
            "A thread of normal priority that looks once a millisecond; the bridge sends every two. "
            (num(r.host.snapshots as f64)) " snapshots and " (num(r.host.records as f64)) " records seen, "
            (r.host.records_missing) " records missing, " (r.host.faults) " faults" @if r.host.faults > 0 { ": " (r.host.which_faults.join("; ")) } "."
        }
    }
}

pub fn comparison(r: &Report) -> Markup {
    let Some(c) = &r.comparison else {
        return Markup::default();
    };
    let title = c.against.title();
    if let Some(why) = &c.absent {
        return html! { h2 { (title) } p { (why) } };
    }
    let mut rows: Vec<Vec<Markup>> = Vec::new();
    for (i, round) in c.rounds.iter().enumerate() {
        let cells = (0..c.names.len()).flat_map(|k| [round.ours_us[k], round.others_us[k], round.ratio[k]].map(or_na));
        rows.push([cell(i + 1)].into_iter().chain(cells).collect());
    }
    let ratio = |median: &Option<f64>| html! { b { (or_na(*median)) } };
    let median = c.median_ratio.iter().flat_map(|m| [cell(""), cell(""), ratio(m)]);
    rows.push([html! { b { "median" } }].into_iter().chain(median).collect());
    let mut head = vec![cell("round")];
    for name in &c.names {
        head.extend(c.against.sides().map(|whose| html! { (name) br; (whose) }));
        head.push(cell("ratio"));
    }
    let turns = num(c.turn_s);
    html! {
        h2 { (title) }
        (table(&head, &rows, &vec![Column::Number; head.len()]))
        p class="faint" {
            (c.tool) " Alternating, turns of " (turns) " s, microseconds."
            @if c.against == Against::Cyclictest {
                " Same core, priority and interval, both read right after the sleep. The force loop does all its work, \
                 cyclictest sleeps only."
            }
            " Values past 1 ms are left out of p99 and p99.9."
        }
    }
}

/// Shows how `--spin-us auto` chose its spin.
pub fn spin(r: &Report) -> Markup {
    let Some(s) = &r.spin_search else {
        return Markup::default();
    };
    html! { h2 { "Spin before each deadline" } p { (micro(&s.words())) "." } }
}

/// Tabulates the wake-ups of the loop and of its witness.
pub fn paired(r: &Report) -> Markup {
    let Some(p) = &r.paired else {
        return Markup::default();
    };
    let wake = r.haptic.times.iter().find(|t| t.name == "wake-up");
    let times: Vec<Summary> = wake.into_iter().chain([&p.witness]).cloned().collect();
    html! {
        h2 { "Beside a witness" }
        (time_table(&times))
        p { (micro(&p.words())) "." }
        p class="faint" {
            "The witness only sleeps, on the same core for the same deadlines, one priority above. A late wake-up is of the \
             loop alone if the witness was less than half as late. Where both are late, the machine or a thread that nothing \
             preempts had the core. The witness makes each tick a few microseconds later."
        }
    }
}

pub fn late(r: &Report) -> Markup {
    let row = |l: &crate::report::Late| {
        vec![
            cell(format!("{:.3}", l.at_s)),
            count(l.wake_us),
            count(l.work_us),
            cell(micro(&l.cause)),
        ]
    };
    let rows: Vec<Vec<Markup>> = r.latest_wake_ups.iter().map(row).collect();
    let head = ["at, s", "wake-up, \u{b5}s", "work, \u{b5}s", "cause"];
    let columns = [Column::Number, Column::Number, Column::Number, Column::Wide];
    html! {
        h2 { "Latest wake-ups" }
        (table(&head, &rows, &columns))
        @if r.trace.is_none() {
            p class="faint" { "With " code { "--trace" } " a trace of the kernel names the cause of each." }
        }
    }
}

/// Tabulates what took the loop's core before the loop started.
pub fn noise(r: &Report) -> Markup {
    let Some(n) = &r.noise else {
        return Markup::default();
    };
    let row = |gap: &NoiseGap| vec![cell(format!("{:.3}", gap.at_s)), count(gap.us), cell(micro(&gap.cause))];
    let rows: Vec<Vec<Markup>> = n.longest.iter().map(row).collect();
    html! {
        h2 { "The loop's core before the loop started" }
        @if !rows.is_empty() {
            (table(&["at, s", "gap, \u{b5}s", "cause"], &rows, &[Column::Number, Column::Number, Column::Wide]))
        }
        p { (micro(&n.words())) "." }
        p class="faint" {
            "A thread of the loop's priority spun there without a load and read the clock. No change of the loop avoids these \
             gaps."
        }
    }
}
