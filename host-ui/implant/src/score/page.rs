//! The debrief: one self-contained page, with its pictures.

use super::{Score, ScoreError, picture, updates};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use stylet_base::format;

/// Style of every page.
pub const STYLE: &str = "\
:root{--ink:#1c2126;--soft:#5b6570;--line:#d9dee3;--card:#f5f7f9;--planned:#0072b2;--delivered:#d55e00}
*{box-sizing:border-box}
body{font:15px/1.5 system-ui,'Segoe UI',Roboto,'Liberation Sans',sans-serif;color:var(--ink);background:#fff;margin:0}
main{max-width:1220px;margin:0 auto;padding:28px 24px 48px}
h1{font-size:26px;font-weight:650;margin:0 0 2px}
h2{font-size:18px;font-weight:650;margin:36px 0 10px}
p{margin:4px 0;color:var(--soft)}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(180px,1fr));gap:12px;margin:22px 0 0}
.card{background:var(--card);border-radius:8px;padding:12px 14px}
.card b{display:block;font-size:20px;font-weight:650;font-variant-numeric:tabular-nums;white-space:nowrap}
.card span{color:var(--soft);font-size:13px}
svg{width:100%;height:auto;display:block}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{padding:5px 10px;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
th{font-size:13px;font-weight:600;color:var(--soft);vertical-align:bottom}
td:first-child,th:first-child{text-align:left}
.scroll{overflow-x:auto}
.key{display:flex;gap:22px;flex-wrap:wrap;color:var(--soft);font-size:14px;margin:0 0 6px}
.key i{display:inline-block;width:12px;height:12px;border-radius:50%;vertical-align:-1px;margin-right:6px}
.key .line{width:22px;height:0;border-radius:0;border-top:2px solid var(--ink);vertical-align:4px}
.bad{color:#a33c00;font-weight:600}
footer{margin-top:40px;border-top:1px solid var(--line);padding-top:12px}
@media(max-width:1180px){.cards{grid-template-columns:repeat(3,1fr)}}
@media print{.card{border:1px solid var(--line)}h2{break-after:avoid}}
";

/// Most seeds in the table; the others are in the JSON.
const ROWS: usize = 20;

/// Returns the page as HTML; an error if a picture cannot be drawn.
pub fn page(score: &Score) -> Result<String, ScoreError> {
    let i = &score.implant;
    let views = picture::views(score)?;
    let dvh = picture::dvh(score)?;
    let over_time = picture::over_time(i.records)?;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { "Debrief: " (i.title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main {
                    h1 { "Debrief" }
                    p {
                        (i.title) " · " (i.pairs.len()) " seeds " (i.source) " · prescription "
                        (format!("{:.0}", i.prescription_gy)) " Gy"
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
                }
            }
        }
    };
    Ok(page.into_string())
}

fn moments(score: &Score) -> Markup {
    html! {
        @if !score.implant.moments.is_empty() {
            h2 { "Marks, exercises and faults" }
            div class="scroll" {
                table {
                    thead { tr { th { "Time (s)" } th { "what" } th { "words" } } }
                    tbody {
                        @for moment in &score.implant.moments {
                            tr {
                                td { (format!("{:.1}", score.at_s(moment))) }
                                td { (moment.kind.name()) }
                                td { (moment.text) }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn lost(score: &Score) -> Markup {
    let (lost, placed) = (score.implant.lost.len(), score.implant.pairs.len());
    html! {
        @if lost > 0 {
            p class="bad" {
                (lost) " of " (placed + lost) " planned seeds were lost: the tip was outside the tissue when they were dropped."
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
            format!("{:.1} mm", mean * 1e3),
            format!("mean seed error, worst {:.1} mm", worst * 1e3),
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
            format!("mean speed inwards, peak {:.0} mm/s", m.peak_insertion_m_per_s * 1e3),
        ),
        (
            clock(m.duration_s),
            format!("{} insertions, {} re-insertions", m.insertions, m.reinsertions),
        ),
    ];
    let bent = (m.deflection_m > 0.0).then(|| {
        (
            format!("{:.1} mm", m.deflection_m * 1e3),
            "largest deflection of the tip".to_owned(),
        )
    });
    html! {
        div class="cards" {
            @for (value, what) in all.iter().chain(&bent) {
                div class="card" { b { (value) } span { (what) } }
            }
        }
        @if !m.seen.is_all() {
            p class="note" { "Force, speed and times cover the ticks that were seen: " (m.seen.words()) "." }
        }
    }
}

fn clock(seconds: f64) -> String {
    format!("{}:{:04.1} min", (seconds / 60.0) as u64, seconds % 60.0)
}

/// Returns every measure of every structure, planned next to delivered.
fn measures(score: &Score) -> Markup {
    let (planned, delivered) = (score.judge.values(&score.planned), score.judge.values(&score.delivered));
    let number = |v: &Option<f64>, name: &str| {
        v.map_or_else(|| "not defined".to_owned(), |v| format::decimal(v, decimals(name)))
    };
    let change = |before: &Option<f64>, after: &Option<f64>, name: &str| match (before, after) {
        (Some(b), Some(a)) => format::signed(a - b, decimals(name)),
        _ => String::new(),
    };
    html! {
        div class="scroll" {
            table {
                thead { tr { th { "Measure" } th { "planned" } th { "delivered" } th { "change" } } }
                tbody {
                    @for ((name, before), (_, after)) in planned.iter().zip(&delivered) {
                        tr {
                            td { (named(name)) }
                            td { (number(before, name)) }
                            td { (number(after, name)) }
                            td { (change(before, after, name)) }
                        }
                    }
                }
            }
        }
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
    html! {
        div class="scroll" {
            table {
                thead {
                    tr {
                        th { "Seed" } th { "needle" } th { "hole" }
                        th { "error" br; "(mm)" } th { "along" br; "(mm)" } th { "across" br; "(mm)" }
                        th { "D90 lost" br; "(Gy)" } th { "V100 lost" br; "(%)" }
                        @if has_urethra {
                            th { "urethra D10" br; "saved (Gy)" } th { "urethra D30" br; "saved (Gy)" }
                        }
                    }
                }
                tbody {
                    @for &n in order.iter().take(ROWS) {
                        (seed(score, n))
                    }
                }
            }
        }
        @if order.len() > ROWS {
            p { "The other " (order.len() - ROWS) " seeds are in score.json." }
        }
    }
}

fn seed(score: &Score, n: usize) -> Markup {
    let (pair, cost) = (&score.implant.pairs[n], &score.costs[n]);
    let hole = pair.hole.map_or_else(|| "–".to_owned(), |h| h.to_string());
    let is_costly = cost.target_d90_gy > 0.5;
    html! {
        tr {
            td { (n + 1) } td { (pair.needle + 1) } td { (hole) }
            td { (format!("{:.2}", pair.error_m() * 1e3)) }
            td { (format::signed_mm(pair.error_along_m())) }
            td { (format!("{:.2}", pair.error_across_m() * 1e3)) }
            td class=[is_costly.then_some("bad")] { (format::decimal(cost.target_d90_gy, 2)) }
            td { (format::decimal(cost.target_v100_percent, 3)) }
            @for gy in [cost.urethra_d10_gy, cost.urethra_d30_gy].into_iter().flatten() {
                td { (format::decimal(gy, 2)) }
            }
        }
    }
}
