//! The page: every distribution with published values, dose, and provenance. Self-contained.

use crate::dose::{Covered, ImplantDose, Scored};
use crate::error::PopulationError;
use crate::figures::{Distribution, MANY, gaps_mm, influences, touching};
use crate::picture;
use crate::published::{PUBLISHED, Published, published_in};
use crate::shards::Population;
use maud::{Markup, PreEscaped, html};
use std::collections::BTreeMap;
use stylet_base::format::{self, printable};
use stylet_dose::criteria::Limit;
use stylet_insertions::Insertion;
use stylet_report::parts::{self, Column, cell, num};

const OWN: &str = "\
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(460px,1fr));gap:26px 30px}
figure h3{margin:0 10px 2px}
figcaption{color:var(--soft);font-size:13px;font-weight:400;line-height:1.4}
figcaption b{color:var(--ink);font-weight:600;font-variant-numeric:tabular-nums}
figcaption .ref{color:#b04a00}
pre{background:var(--card);border-radius:8px;padding:12px 14px;font-size:12.5px;line-height:1.45;overflow-x:auto}
code{font-size:.93em}
.bar{display:inline-block;height:9px;border-radius:2px;background:var(--planned);vertical-align:1px}
.bar.minus{background:var(--delivered)}
";

/// Rank correlation below which an influence on the misplacement is indistinguishable from chance
/// and left out.
const LEAST_CORRELATION: f64 = 0.05;

/// Returns the page as HTML.
///
/// # Errors
///
/// If a picture cannot be drawn.
pub fn page(p: &Population, scored: &Scored, figures: &[Distribution]) -> Result<String, PopulationError> {
    let plots = figures.iter().map(plot).collect::<Result<Vec<_>, _>>()?;
    let main = html! {
        (head(p, scored))
        (cards(figures))
        (warnings(p, scored))
        h2 { "Distributions" }
        p class="key" {
            span { i class="line" {} "median of the simulation" }
            span { i class="line" style="border-top:2px dashed #d55e00" {} "published, numbered as in the caption" }
        }
        div class="plots" { @for plot in &plots { (plot) } }
        (neighbours(&p.table.rows))
        (dose(scored))
        (what_goes_with_it(p))
        (published_table())
        (made(p))
    };
    Ok(stylet_report::page(
        &format!("Study {}", printable(&p.table.about.study)),
        OWN,
        &main,
    ))
}

fn head(p: &Population, scored: &Scored) -> Markup {
    let rows = &p.table.rows;
    let seeds: usize = rows.iter().map(|row| row.seeds.len()).sum();
    let mut glands: Vec<String> = rows
        .iter()
        .map(|row| format!("{} with {}, {}", row.scene, row.plan, row.tissue))
        .collect();
    glands.sort();
    glands.dedup();
    html! {
        h1 { "Study " (printable(&p.table.about.study)) }
        p {
            (thousands(rows.len())) " insertions of " (thousands(scored.implants.len() + scored.incomplete)) " implants, "
            (thousands(seeds)) " seeds, through the two ticks of the live simulator. " (printable(&glands.join("; "))) "."
        }
    }
}

fn cards(figures: &[Distribution]) -> Markup {
    let of = |name: &str| figures.iter().find(|d| d.name == name);
    let names = [
        "Seed misplacement",
        "Shift of the gland",
        "Peak force on the hand",
        "Duration of an insertion",
        "D90 of the implant",
        "V100 of the implant",
    ];
    parts::cards(names.into_iter().filter_map(of).map(|d| {
        let unit = d.unit.split(' ').next().unwrap_or_default();
        (
            html! { b { (value(d.percentile(50.0))) " " (unit) } },
            html! { (d.name) ", median" br; (range(d)) },
        )
    }))
}

fn warnings(p: &Population, scored: &Scored) -> Markup {
    let [found, of] = p.shards;
    let mut reasons: BTreeMap<&String, usize> = BTreeMap::new();
    for why in p.table.rows.iter().filter_map(|row| row.outcome.as_ref().err()) {
        *reasons.entry(why).or_default() += 1;
    }
    let failed: usize = reasons.values().sum();
    let mut reasons: Vec<_> = reasons.into_iter().collect();
    reasons.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    html! {
        @if found < of {
            p class="warning" { (found) " of " (of) " shards are finished: the page shows these alone." }
        }
        @if failed > 0 {
            p class="warning" {
                "Failed insertions, in no distribution: " (thousands(failed)) " of " (thousands(p.table.rows.len())) ". "
                @for (why, count) in reasons.iter().take(5) { (count) " \u{d7} \u{201c}" (printable(why)) "\u{201d}. " }
            }
        }
        @if scored.incomplete > 0 {
            p class="warning" {
                "Implants without a dose: " (scored.incomplete) ". A needle failed, or its shard is not finished."
            }
        }
        @if let Some(why) = &scored.missing { p class="warning" { "No dose was computed: " (printable(why)) } }
    }
}

fn plot(d: &Distribution) -> Result<Markup, PopulationError> {
    let published: Vec<&Published> = published_in(d.name).collect();
    let (svg, beyond) = picture::distribution(d, &published)?;
    Ok(html! {
        figure {
            h3 { (d.name) }
            (PreEscaped(svg))
            figcaption {
                (thousands(d.values.len())) " " (d.each) "s: mean " b { (value(d.mean())) } ", SD " (value(d.deviation())) ", median "
                b { (value(d.percentile(50.0))) } ", " (range(d))
                @if d.values.len() >= MANY { ", largest " (value(d.percentile(100.0))) }
                " " (d.unit) "."
                @if beyond > 0 { " The last bar includes " (beyond) " beyond it." }
                @for (n, p) in published.iter().enumerate() {
                    br; span class="ref" { (n + 1) " published: " (p.value) " " (p.unit) } ", " (p.how) " (" (p.source) "; " (p.used.name()) ")"
                }
            }
        }
    })
}

fn range(d: &Distribution) -> String {
    let [low, high] = d.range().map(|(name, of)| format!("{name} {}", value(of)));
    format!("{low}, {high}")
}

fn neighbours(rows: &[Insertion]) -> Markup {
    let mut of_plan: BTreeMap<&String, Vec<&Insertion>> = BTreeMap::new();
    for row in rows {
        of_plan.entry(&row.plan).or_default().push(row);
    }
    let row = |(plan, rows): (&String, Vec<&Insertion>)| {
        let gaps_mm = gaps_mm(rows);
        let nearest_mm = gaps_mm.iter().copied().reduce(f64::min)?;
        let (touch, of) = (touching(&gaps_mm), gaps_mm.len());
        Some(vec![
            cell(printable(plan)),
            cell(thousands(of)),
            cell(thousands(touch)),
            cell(value(Some(100.0 * touch as f64 / of as f64))),
            cell(format!("{nearest_mm:.3}").replace('-', "\u{2212}")),
        ])
    };
    let rows: Vec<_> = of_plan.into_iter().filter_map(row).collect();
    if rows.is_empty() {
        return html! {};
    }
    let head = [
        "plan",
        "pairs of neighbours on a needle",
        "touch",
        "%",
        "nearest from end to end, mm",
    ];
    html! {
        h2 { "Seeds that touch" }
        (parts::numbers(&head, &rows))
    }
}

fn dose(scored: &Scored) -> Markup {
    if scored.implants.is_empty() {
        return html! {};
    }
    let met = |limit: Limit, of: fn(&Covered) -> f64| {
        let all = scored.implants.iter().map(|i| of(&i.delivered));
        format!(
            "{} of {}",
            all.filter(|v| limit.is_met(*v)).count(),
            scored.implants.len()
        )
    };
    let row = |name: &str, limit: f64, of: fn(&Covered) -> f64| {
        let limit = Limit::AtLeast(limit);
        let column = |of_implant: &dyn Fn(&ImplantDose) -> f64| {
            Distribution::new("", "%", "implant", scored.implants.iter().map(of_implant).collect())
        };
        let (planned, delivered) = (column(&|i| of(&i.planned)), column(&|i| of(&i.delivered)));
        let figures = [planned.mean(), delivered.mean(), delivered.deviation()];
        let percentiles = [5.0, 50.0, 95.0].map(|p| delivered.percentile(p));
        let values = figures.into_iter().chain(percentiles).map(|v| cell(value(v)));
        let judged = [cell(limit.to_string()), cell(met(limit, of))];
        std::iter::once(cell(name)).chain(values).chain(judged).collect()
    };
    let rows = [
        row("D90, % of the prescription", 100.0, |c| c.d90_percent),
        row("D90, % of the prescription", 90.0, |c| c.d90_percent),
        row("V100, % of the target", 95.0, |c| c.v100_percent),
    ];
    html! {
        h2 { "Dose of the target" }
        p { "TG-43U1, as the plan has its seeds and as they came to rest; every needle began in a gland at rest, so that "
            "needles that only push or hold the gland are not part of it." }
        (parts::numbers(&["", "planned, mean", "delivered, mean", "SD", "p5", "median", "p95", "limit", "met by implants"], &rows))
    }
}

fn what_goes_with_it(p: &Population) -> Markup {
    let found = influences(&p.table);
    if found.is_empty() {
        return html! {};
    }
    let (shown, rest): (Vec<_>, Vec<_>) = found.into_iter().partition(|(_, r)| r.abs() >= LEAST_CORRELATION);
    let row = |(name, r): &(String, f64)| {
        let (class, width) = (if *r < 0.0 { "bar minus" } else { "bar" }, 320.0 * r.abs());
        vec![
            html! { code { (name) } },
            cell(format!("{r:+.2}").replace('-', "\u{2212}")),
            html! { span class=(class) style=(format!("width:{width:.0}px")) {} },
        ]
    };
    let rows: Vec<_> = shown.iter().map(row).collect();
    html! {
        h2 { "Influences on the misplacement" }
        p { "Rank correlation (Spearman) of the varied quantities with the mean misplacement of a needle; correlation is not causation." }
        (parts::table(&["quantity", "correlation", ""], &rows, &[Column::Text, Column::Number, Column::Text]))
        @if !rest.is_empty() {
            p { "Below " (LEAST_CORRELATION) ": " (rest.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")) "." }
        }
    }
}

fn published_table() -> Markup {
    let head = ["measured", "value", "of what", "source", "used as", "remarks"];
    let row = |p: &Published| {
        let value = html! { (p.value) " " (p.unit) };
        vec![
            cell(&p.what),
            value,
            cell(&p.how),
            cell(&p.source),
            cell(p.used.name()),
            cell(&p.note),
        ]
    };
    let rows: Vec<_> = PUBLISHED.iter().map(row).collect();
    html! {
        h2 { "Published values" }
        p {
            "Fitted: a parameter of " code { "docs/study/people.toml" } " was fitted to it, so that agreement proves nothing. Check: no parameter \
             was fitted to it. Context: another organ, needle or cause than what is simulated."
        }
        (parts::table(&head, &rows, &[Column::Text, Column::Number]))
    }
}

fn made(p: &Population) -> Markup {
    let about = &p.table.about;
    html! {
        h2 { "The study" }
        pre { (printable_lines(&about.definition)) }
        footer {
            p { "Made by " (printable(&about.made_by)) ", page by host-ui " (env!("CARGO_PKG_VERSION")) ", " (format::local_now()) ". "
                (p.files.len()) " files; SHA-256 of the rows, independent of the shards: " code { (p.digest) } }
            p { "Query the same files: " code { "duckdb -c \"SELECT scene, avg(peak_force_n) FROM 'shard-*.parquet' GROUP BY scene\"" } }
            p { "Made by a simulator for research and training. Not a medical device." }
        }
    }
}

fn printable_lines(text: &str) -> String {
    text.lines()
        .map(printable)
        .map(|line| line.to_string())
        .collect::<Vec<_>>()
        .join("\n")
}

/// Returns three significant digits, as people read them.
fn value(value: Option<f64>) -> String {
    value.map_or_else(|| "\u{2013}".to_owned(), |v| num(v).replace('-', "\u{2212}"))
}

fn thousands(count: usize) -> String {
    num(count as f64)
}
