//! The credibility file as a page; every id is a link target.

use super::runs::Run;
use super::tables::{Category, Factor, Hazard, PROBABILITIES, Probability, SEVERITIES, Severity, risk};
use super::{Credibility, Traced};
use crate::provenance::Package;
use maud::{Markup, html};
use std::collections::BTreeMap;
use stylet_report::parts::{Column, cell, table};

/// Returns the whole page, which is self-contained.
pub fn page(c: &Credibility) -> String {
    let main = html! {
        header { h1 { "Credibility file of Stylet" } }
        p class="sub" { (c.made_at) ", " (c.program) ", commit " code { (c.commit) } "." }
        div class="warning" { strong { "No claim of conformity." } " " (c.claim) }
        h2 { "Context of use" }
        @for (heading, text) in c.context { h3 { (heading) } p { (text) } }
        h2 { "Hazards" }
        p class="faint" {
            "Severity and probability are the authors' estimates, in the levels of ISO/TR 24971: there are no figures from use. "
            "Whether a risk is acceptable is for whoever uses Stylet to decide."
        }
        (hazards(c))
        (matrix())
        h2 { "Requirements, hazards, tests, runs" }
        p class="faint" {
            "A test is named by its file in the repository and its function; all of them run in " code { "make test-all" } ". "
            "The last column has the outcomes of the runs below, by their number."
        }
        (requirements(c))
        h2 { "Runs" }
        (runs(c))
        h2 { "Evidence by the categories of the FDA's guidance (2023)" }
        (categories(c))
        h2 { "Credibility factors of ASME V&V 40-2018" }
        (factors(c))
        h2 { "Software of unknown provenance" }
        (packages(c))
        footer { "Made by " code { "rt-core credibility" } ". Schema " (c.schema) "." }
    };
    stylet_report::page("Credibility file of Stylet", "", &main)
}

/// Returns a link target with this id.
fn anchor(id: &str) -> Markup {
    html! { code id=(id) { (id) } }
}

fn link(id: &str) -> Markup {
    html! { a href={ "#" (id) } { code { (id) } } }
}

fn hazards(c: &Credibility) -> Markup {
    let row = |h: &Hazard| {
        let held_by = c.requirements.iter().filter(|r| r.requirement.hazards.contains(&h.id));
        let held_by = html! { @for r in held_by { (link(&r.requirement.id)) " " } };
        let level = |probability| html! { (word(probability)) br; strong { (risk(h.severity, probability)) " risk" } };
        vec![
            anchor(&h.id),
            html! { (h.hazard) br; span class="faint" { (h.situation) } },
            html! { (h.harm) br; span class="faint" { (word(h.severity)) } },
            level(h.before),
            held_by,
            level(h.after),
            cell(&h.remains),
        ]
    };
    let rows: Vec<_> = c.hazards.iter().map(row).collect();
    let head = [
        "id",
        "hazard and situation",
        "harm and severity",
        "before controls",
        "controls",
        "residual risk",
        "what remains",
    ];
    table(&head, &rows, &[])
}

/// Writes a level as the file has it.
fn word(level: impl std::fmt::Debug) -> String {
    format!("{level:?}").to_lowercase()
}

fn matrix() -> Markup {
    let row = |severity: Severity| {
        let risks = PROBABILITIES.iter().map(|p: &Probability| cell(risk(severity, *p)));
        std::iter::once(cell(word(severity))).chain(risks).collect::<Vec<_>>()
    };
    let rows: Vec<_> = SEVERITIES.iter().rev().map(|s| row(*s)).collect();
    let head: Vec<String> = PROBABILITIES.iter().map(word).collect();
    let head: Vec<&str> = std::iter::once("risk by severity and probability")
        .chain(head.iter().map(String::as_str))
        .collect();
    html! { details { summary { "How a risk is rated" } (table(&head, &rows, &[])) } }
}

fn requirements(c: &Credibility) -> Markup {
    let row = |t: &Traced| {
        let r = t.requirement;
        vec![
            anchor(&r.id),
            cell(&r.what),
            html! { @for id in &r.hazards { (link(id)) " " } },
            html! { @for (file, test) in &r.tests { div { code { (test) } br; span class="faint" { (file) } } } },
            html! {
                @if t.outcomes.is_empty() { span class="na" { "no run given" } }
                @for (run, outcome) in &t.outcomes {
                    a href={ "#RUN-" (run) } { "run " (run) } ": " (outcome.to_lowercase()) br;
                }
            },
        ]
    };
    let columns = [Column::Text, Column::Text, Column::Text, Column::Wide];
    let rows: Vec<_> = c.requirements.iter().map(row).collect();
    table(&["id", "requirement", "hazards", "tests", "runs"], &rows, &columns)
}

fn runs(c: &Credibility) -> Markup {
    if c.runs.is_empty() {
        return html! {
            p { "None was given. " code { "rt-core credibility --run DIR" } " takes the report of " code { "rt-core latency --out DIR" } "." }
        };
    }
    let row = |(i, r): (usize, &Run)| {
        let environment = if r.qualified { "qualified" } else { "not qualified" };
        vec![
            anchor(&format!("RUN-{i}")),
            cell(&r.made_at),
            cell(&r.protocol),
            cell(r.overall),
            cell(environment),
            html! { (r.file) br; span class="faint" { (r.sha256) } },
        ]
    };
    let text = Column::Text;
    let rows: Vec<_> = (1..).zip(&c.runs).map(row).collect();
    let head = ["id", "made", "measured", "verdict", "environment", "file and SHA-256"];
    table(&head, &rows, &[text, text, text, text, text, Column::Wide])
}

fn categories(c: &Credibility) -> Markup {
    let row = |k: &Category| {
        vec![
            cell(k.number),
            cell(&k.name),
            html! { @for (what, place) in &k.there { div { (what) " " span class="faint" { (place) } } } },
            missing(&k.missing),
        ]
    };
    let rows: Vec<_> = c.categories.iter().map(row).collect();
    table(
        &["", "category", "what there is", "what is missing"],
        &rows,
        &[Column::Number],
    )
}

fn factors(c: &Credibility) -> Markup {
    let place = |of: &String| {
        let is_requirement = c.requirements.iter().any(|r| r.requirement.id == *of);
        html! { div { @if is_requirement { (link(of)) } @else { span class="faint" { (of) } } } }
    };
    let row = |f: &Factor| {
        vec![
            html! { (f.name) br; span class="faint" { (f.activity) } },
            html! { @if f.what.is_empty() { span class="na" { "nothing" } } @else { (f.what) } },
            html! { @for of in &f.evidence { (place(of)) } },
            missing(&f.missing),
        ]
    };
    let rows: Vec<_> = c.factors.iter().map(row).collect();
    table(&["factor", "what was done", "evidence", "what is missing"], &rows, &[])
}

fn missing(text: &str) -> Markup {
    html! { @if text.is_empty() { span class="na" { "nothing known" } } @else { (text) } }
}

fn packages(c: &Credibility) -> Markup {
    let mut licences: BTreeMap<&str, usize> = BTreeMap::new();
    for p in &c.packages {
        *licences.entry(p.licence).or_default() += 1;
    }
    let mut licences: Vec<_> = licences.into_iter().collect();
    licences.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    let counts: Vec<_> = licences
        .iter()
        .map(|(licence, n)| vec![cell(licence), cell(n)])
        .collect();
    let row = |p: &Package| {
        vec![
            cell(p.name),
            cell(p.version),
            cell(p.licence),
            cell(p.of),
            cell(p.known_anomalies.join(" ")),
        ]
    };
    let rows: Vec<_> = c.packages.iter().map(row).collect();
    let text = Column::Text;
    html! {
        p { (c.packages.len()) " packages, as locked; licences as their authors declare them." }
        div class="half" { (table(&["licence", "packages"], &counts, &[text, Column::Number])) }
        details {
            summary { "All packages, with what we know to be wrong with them" }
            (table(&["package", "version", "licence", "program", "known anomalies"], &rows, &[text, text, text, text, Column::Wide]))
        }
    }
}
