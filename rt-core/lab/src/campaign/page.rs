//! The page of a campaign.

use super::report::{CampaignReport, LoopOfPart, PartReport};
use super::time;
use crate::html::times::time_table;
use crate::html::{badge, limits, whose};
use crate::plots::{self, DrawError, MaximaPart};
use maud::{Markup, PreEscaped, html};
use stylet_report::parts::{Column, cell, num, or_na, table};

/// Returns the whole page, which is self-contained.
pub fn page(r: &CampaignReport) -> Result<String, DrawError> {
    let title = format!(
        "Latency campaign{}{}",
        if r.name.is_empty() { "" } else { ": " },
        r.name
    );
    let pictures = pictures(r)?;
    let main = html! {
        header { h1 { (title) } (badge(r.verdict)) }
        p class="sub" {
            b { (time(r.measured_s)) } " of " (time(r.planned_s)) " measured in " (r.sessions.len()) " sessions. "
            (r.about.made_at) ", " (r.about.program) "."
        }
        @if let Some(whose) = whose(&r.about.whose) { p class="sub" { (whose) } }
        @if let Some(nonce) = &r.about.nonce { p class="sub" { "Answers the challenge " code { (nonce) } "." } }
        @if !r.complete { div class="warning" { strong { "Not complete." } " The same command continues it." } }
        @if let Some(name) = &r.about.hypervisor {
            div class="warning" {
                strong { "Environment not qualified." }
                " This is a virtual machine (" (name) "): the tail says more about the machine below than about this program."
            }
        }
        h2 { "Parts" }
        (overview(r))
        (pictures)
        @for (i, part) in r.parts.iter().enumerate() { (of_part(i, part)) }
        h2 { "Sessions" }
        (sessions(r))
        footer {
            "A session is what one start of the program measured without a break. Its file is replaced at each checkpoint; \
             what was measured after the last checkpoint of a session that was killed is not counted, and was measured \
             again. Two sessions of the same moment are refused. Last digest of the chain of checkpoints: " code { (r.chain) } ". Commit " code { (r.about.commit) } ", schema " (r.schema) "."
        }
    };
    Ok(stylet_report::page(&title, "", &main))
}

fn overview(r: &CampaignReport) -> Markup {
    let us = |l: &LoopOfPart, q: &str| or_na(l.wake.quantile(q).and_then(|q| q.us));
    let row = |(i, part): (usize, &PartReport)| {
        let f = &part.force;
        vec![
            cell(i + 1),
            cell(part.part.name()),
            cell(time(part.measured_s)),
            cell(part.sessions),
            us(f, "p50"),
            us(f, "p99"),
            us(f, "p99.9"),
            us(f, "p99.99"),
            or_na(f.wake.max_us),
            cell(num(f.missed_deadlines as f64)),
            or_na(f.miss_bound.at_most_per_hour),
        ]
    };
    let rows: Vec<Vec<Markup>> = r.parts.iter().enumerate().map(row).collect();
    let head = [
        "part",
        "load and rate",
        "measured",
        "sessions",
        "p50, \u{b5}s",
        "p99",
        "p99.9",
        "p99.99",
        "max",
        "missed",
        "an hour, at most",
    ];
    let mut columns = [Column::Number; 11];
    columns[1] = Column::Text;
    html! {
        (table(&head, &rows, &columns))
        p class="faint" {
            "Wake-up of the force loop. The last column is the bound of Clopper and Pearson on missed deadlines, 95 %, if they do not \
             depend on each other."
        }
    }
}

fn pictures(r: &CampaignReport) -> Result<Markup, DrawError> {
    let names: Vec<String> = r.parts.iter().map(|p| p.part.name()).collect();
    let measured = || r.parts.iter().zip(&names).filter(|(p, _)| !p.maxima.is_empty());
    if measured().next().is_none() {
        return Ok(Markup::default());
    }
    let parts: Vec<MaximaPart> = measured()
        .map(|(p, name)| MaximaPart {
            name,
            windows: p
                .maxima
                .iter()
                .map(|m| {
                    let measured = f64::from(m.ticks) + f64::from(m.missed);
                    (measured / f64::from(p.part.rate), m.worst_wake_us, m.worst_work_us)
                })
                .collect(),
        })
        .collect();
    let maxima = plots::maxima(&parts)?;
    Ok(html! {
        h2 { "Worst of each " (time(r.window_s)) }
        figure { (PreEscaped(maxima)) }
    })
}

fn of_part(i: usize, part: &PartReport) -> Markup {
    let of = |l: &LoopOfPart| [l.wake.clone(), l.work.clone(), l.due_to_output.clone()];
    html! {
        h2 { "Part " (i + 1) ": " (part.part.name()) }
        (limits(&part.limits))
        h3 { "Force loop" }
        (time_table(&of(&part.force)))
        h3 { "Tissue loop" }
        (time_table(&of(&part.tissue)))
        p class="faint" {
            "Force loop: " (num(part.force.ticks as f64)) " ticks, " (part.force.missed_deadlines) " deadlines missed, "
            (part.force.overruns) " overruns, " (part.force.unmeasured) " ticks not measured. Tissue loop: "
            (num(part.tissue.ticks as f64)) " ticks, " (part.tissue.missed_deadlines) " missed."
        }
    }
}

fn sessions(r: &CampaignReport) -> Markup {
    let moment = |s: f64| {
        let at = jiff::Timestamp::from_second(s as i64);
        at.map_or(String::new(), |t| t.strftime("%Y-%m-%d %H:%M:%S UTC").to_string())
    };
    let rows: Vec<Vec<Markup>> = r
        .sessions
        .iter()
        .map(|s| {
            vec![
                cell(s.part + 1),
                cell(moment(s.began_s)),
                cell(time(s.measured_s)),
                html! { code { (s.boot.split('-').next().unwrap_or_default()) } },
                html! { (s.file) br; span class="faint" { (s.sha256) } },
            ]
        })
        .collect();
    let head = ["part", "began", "measured", "start of the PC", "file and its SHA-256"];
    let columns = [Column::Number, Column::Text, Column::Number, Column::Text, Column::Wide];
    table(&head, &rows, &columns)
}
