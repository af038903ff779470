//! The debrief: one self-contained page, with its pictures.

use super::{Score, ScoreError, picture, updates};
use maud::{Markup, PreEscaped, html};
use stylet_base::format;
use stylet_dose::criteria::shown;
use stylet_host::moments::Moment;
use stylet_report::parts::{self, Column, cell};

/// Most seeds in the table; the others are in the JSON.
const ROWS: usize = 20;

/// Returns the page as HTML; an error if a picture cannot be drawn.
pub fn page(score: &Score) -> Result<String, ScoreError> {
    let i = &score.implant;
    let views = picture::views(score)?;
    let dvh = picture::dvh(score)?;
    let over_time = picture::over_time(i.records)?;
    let main = html! {
        h1 { "Debrief" }
        p {
            (i.title) " · " (score.seeds()) " seeds " (i.source) " · prescription "
            (format!("{:.0}", i.prescription_gy)) " Gy · " (format::local_now())
        }
        (lost(score))
        (cards(score))
        h2 { "Where the seeds are" }
        div class="key" {
            span { i style="border:2px solid var(--planned)" {} "planned" }
            span { i style="background:var(--delivered)" {} "delivered" }
            span { i class="line" {} "target, cut through its middle" }
            @if !i.anatomy.spared.is_empty() {
                span { i class="line" style="border-color:#cc79a7" {} "to be spared" }
            }
        }
        (PreEscaped(views))
        h2 { "Dose" }
        div class="key" {
            span { i class="line" style="border-top-style:dashed" {} "planned" }
            span { i class="line" {} "delivered" }
        }
        (PreEscaped(dvh))
        (measures(score))
        (updates::section(&i.updates))
        h2 { "Cost of each seed" }
        p {
            "Each line: what the implant would gain if this one seed lay on plan and all others stayed where \
             they are. Largest loss of D90 first."
        }
        (seeds(score))
        h2 { "Force and speed" }
        (PreEscaped(over_time))
        (moments(score))
        footer {
            p {
                "Made by a simulator for research and training. Not a medical device: no treatment may rest \
                 on it."
            }
        }
    };
    Ok(stylet_report::page(&format!("Debrief: {}", i.title), "", &main))
}

fn moments(score: &Score) -> Markup {
    let row = |m: &Moment| {
        vec![
            cell(format!("{:.1}", score.at_s(m))),
            cell(m.kind.name()),
            cell(&m.text),
        ]
    };
    let rows: Vec<_> = score.implant.moments.iter().map(row).collect();
    html! {
        @if !rows.is_empty() {
            h2 { "Marks, exercises and faults" }
            (parts::table(&["Time (s)", "event", "details"], &rows, &[Column::Number]))
        }
    }
}

fn lost(score: &Score) -> Markup {
    let (lost, placed) = (score.implant.lost.len(), score.implant.pairs.len());
    html! {
        @if lost > 0 {
            p class="bad" {
                (lost) " of " (placed + lost) " planned seeds are not in the tissue: they had not been dropped yet, or the tip was "
                "outside when they were. The planned dose is that of all."
            }
        }
        @let (others, all) = (score.implant.unplanned.len(), score.seeds());
        @if others > 0 {
            p class="note" {
                (others) " of the " (all) " seeds " (if others == 1 { "has" } else { "have" })
                " no planned place, and no row below. The delivered dose is that of all."
            }
        }
    }
}

fn cards(score: &Score) -> Markup {
    let [mean, worst] = score.errors_m();
    let m = &score.implant.motion;
    let value = |name: &str, delivered: bool| {
        let verdict = if delivered { &score.delivered } else { &score.planned };
        let values = score.judge.values(verdict);
        values.into_iter().find(|(n, _)| n.contains(name)).and_then(|(_, v)| v)
    };
    let both = |name: &str, digits: usize, unit: &str| match (value(name, false), value(name, true)) {
        (Some(planned), Some(delivered)) => format!("{planned:.digits$} → {delivered:.digits$} {unit}"),
        _ => "not defined".to_owned(),
    };
    let all = [
        (
            format!("{:.2} mm", mean * 1e3),
            format!("mean distance of the seeds from plan, worst {:.2} mm", worst * 1e3),
        ),
        (
            both(" D90 ", 0, "Gy"),
            "D90 of the target, planned → delivered".to_owned(),
        ),
        (
            both(" V100 ", 1, "%"),
            "V100 of the target, planned → delivered".to_owned(),
        ),
        (format!("{:.1} N", m.peak_force_n), "peak force on the hand".to_owned()),
        (
            format!("{:.0} mm/s", m.mean_insertion_m_per_s * 1e3),
            format!("mean insertion speed, peak {:.0} mm/s", m.peak_insertion_m_per_s * 1e3),
        ),
        (
            clock(m.duration_s),
            format!(
                "{}, {}",
                counted(m.insertions, "insertion"),
                counted(m.reinsertions, "re-insertion")
            ),
        ),
    ];
    let bent = (m.deflection_m > 0.0).then(|| {
        (
            format!("{:.1} mm", m.deflection_m * 1e3),
            "largest deflection of the tip".to_owned(),
        )
    });
    html! {
        (parts::cards(all.into_iter().chain(bent).map(|(value, what)| (html! { b { (value) } }, cell(what)))))
        @if m.is_from_middle {
            p class="note" {
                "This window was opened during the procedure: force, speed, times and insertions are those since then."
            }
        }
        @if !m.seen.is_all() {
            p class="note" { "Force, speed and times cover the ticks that were seen: " (m.seen.words()) "." }
        }
    }
}

fn clock(seconds: f64) -> String {
    match (seconds / 60.0) as u64 {
        0 => format!("{seconds:.1} s"),
        minutes => format!("{minutes} min {:.0} s", (seconds % 60.0).floor()),
    }
}

fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Returns every measure of every structure, planned next to delivered, and whether that meets its
/// limit.
fn measures(score: &Score) -> Markup {
    let (planned, delivered) = (score.judge.values(&score.planned), score.judge.values(&score.delivered));
    let number = |v: &Option<f64>, name: &str| {
        v.map_or_else(|| "not defined".to_owned(), |v| format::decimal(v, decimals(name)))
    };
    let change = |before: &Option<f64>, after: &Option<f64>, name: &str| match (before, after) {
        (Some(b), Some(a)) => format::signed(a - b, decimals(name)),
        _ => String::new(),
    };
    let criteria = match score.is_one_needle() {
        true => Vec::new(),
        false => score.judge.criteria(),
    };
    let limit_of = |name: &str| criteria.iter().find(|c| c.measure == name).map(|c| c.limit);
    let number = |v: &Option<f64>, name: &str| match (v, limit_of(name)) {
        (Some(v), limit @ Some(_)) => shown(*v, limit, decimals(name)),
        _ => number(v, name),
    };
    let verdict = |name: &str, after: &Option<f64>| match (limit_of(name), after) {
        (Some(limit), Some(after)) if limit.is_met(*after) => cell(limit.verdict(*after)),
        (Some(limit), Some(after)) => html! { span class="bad" { (limit.verdict(*after)) } },
        _ => cell(""),
    };
    let both = planned.iter().zip(&delivered);
    let rows = both.map(|((name, before), (_, after))| {
        let change = change(before, after, name);
        let limit = limit_of(name).map_or_else(String::new, |limit| limit.to_string());
        let figures = [named(name), number(before, name), number(after, name), change, limit];
        figures.map(cell).into_iter().chain([verdict(name, after)]).collect()
    });
    let head = ["Measure", "planned", "delivered", "change", "limit", "delivered dose"];
    html! {
        (parts::numbers(&head, &rows.collect::<Vec<_>>()))
        @if score.is_one_needle() { p class="note" { "One needle is not an implant: no dose limits apply." } }
    }
}

fn decimals(name: &str) -> usize {
    if name.ends_with("[1]") { 3 } else { 1 }
}

/// Returns the name without its unit in brackets.
fn named(name: &str) -> String {
    let name = name.replace("[gy]", "(Gy)").replace("[percent]", "(%)");
    name.trim_end_matches(" [1]").to_owned()
}

/// Returns the most costly seeds.
fn seeds(score: &Score) -> Markup {
    let mut order: Vec<usize> = (0..score.costs.len()).collect();
    order.sort_by(|&a, &b| score.costs[b].target_d90_gy.total_cmp(&score.costs[a].target_d90_gy));
    let has_urethra = score.costs.first().is_some_and(|c| c.urethra_d10_gy.is_some());
    let mut head = vec![
        "Seed",
        "needle",
        "hole",
        "error, mm",
        "along, mm",
        "across, mm",
        "touches seeds",
        "D90 lost, Gy",
        "V100 lost, %",
    ];
    if has_urethra {
        head.extend(["urethra D10 saved, Gy", "urethra D30 saved, Gy"]);
    }
    let touching = score.touching();
    let rows: Vec<_> = order.iter().take(ROWS).map(|&n| seed(score, n, &touching[n])).collect();
    html! {
        (parts::numbers(&head, &rows))
        @if order.len() > ROWS {
            p { "The other " (order.len() - ROWS) " seeds are in score.json." }
        }
    }
}

fn seed(score: &Score, n: usize, touching: &[usize]) -> Vec<Markup> {
    let touching: Vec<String> = touching.iter().map(ToString::to_string).collect();
    let (pair, cost) = (&score.implant.pairs[n], &score.costs[n]);
    let off = pair.offset();
    let hole = pair.hole.map_or_else(|| "–".to_owned(), |h| h.to_string());
    let is_costly = cost.target_d90_gy > 0.5;
    let lost_gy = format::decimal(cost.target_d90_gy, 2);
    let urethra = [cost.urethra_d10_gy, cost.urethra_d30_gy].into_iter().flatten();
    let mut cells = vec![
        cell(n + 1),
        cell(pair.needle + 1),
        cell(hole),
        cell(format!("{:.2}", off.distance_m() * 1e3)),
        cell(format::signed_mm(off.along_m)),
        cell(format!("{:.2}", off.across_m * 1e3)),
        cell(touching.join(", ")),
        html! { @if is_costly { span class="bad" { (lost_gy) } } @else { (lost_gy) } },
        cell(format::decimal(cost.target_v100_percent, 3)),
    ];
    cells.extend(urethra.map(|gy| cell(format::decimal(gy, 2))));
    cells
}
