//! The page as self-contained HTML that prints on one sheet of A4.

use super::figures::{DEFINITIONS, NotComputed, Row, rows};
use super::slice::Slice;
use super::{Column, Implant};
use maud::{Markup, PreEscaped, html};
use stylet_anatomy::Organ;
use stylet_base::format::{self, printable};
use stylet_dose::criteria::shown;
use stylet_dose::decay::s_to_days;
use stylet_dose::effect::Response;
use stylet_dose::picture::Curve;
use stylet_report::picture::DrawError;

/// Size of the histograms, which leaves the rest on the same sheet.
const HISTOGRAMS: (u32, u32) = (1100, 250);
/// Size of a slice.
const SLICE: (u32, u32) = (240, 236);
/// Most columns in portrait format.
const UPRIGHT: usize = 3;

/// Style of the sheet, smaller than the debrief's, so that everything fits.
const SHEET: &str = "\
body{font-size:13px;line-height:1.35}
main{max-width:1100px;padding:18px 20px}
h1{font-size:21px}h2{font-size:14px;margin:12px 0 4px;padding:0;border:0}
p{margin:4px 0;color:var(--soft)}table{font-size:inherit}th,td{padding:1.5px 8px;text-align:right;white-space:nowrap}td:first-child,th:first-child{text-align:left}.why{white-space:normal;color:var(--soft);font-size:11px}sup{font-size:8px;line-height:0}p.why{margin:3px 8px}
tr.group td{font-weight:650;border-bottom:1px solid var(--ink);padding-top:7px}
td:nth-child(2),th:nth-child(2){text-align:left;color:var(--soft)}
.limits td:nth-child(3),.limits th:nth-child(3){text-align:left;color:var(--soft)}
.limits th{text-align:left}.limits td.v{text-align:left;padding-left:0;font-size:11px;color:var(--soft)}.limits td.v.bad{color:#a33c00}
.slices{display:grid;grid-template-columns:1fr 1fr;gap:6px}.slices p{margin:0;font-size:12px}.key{gap:2px 14px;font-size:11px}
.two{display:grid;grid-template-columns:auto auto;gap:0 26px;align-items:start}
footer{margin-top:10px;padding-top:6px;font-size:10px;line-height:1.3}
footer p{margin:1px 0}
@media print{html{font-size:8pt}body{font-size:8pt;line-height:1.2}main{padding:0;max-width:none}th,td{padding:.4pt 4pt}
h1{font-size:13pt}h2{font-size:9pt;margin:5pt 0 1pt}tr.group td{padding-top:2.5pt}th{font-size:7.5pt}
.why{font-size:6.5pt}sup{font-size:5pt}footer{font-size:6pt;margin-top:4pt;line-height:1.15}}
";

/// Returns the page of one state or of several; an error if its picture cannot be drawn.
pub fn page(implant: &Implant, columns: &[Column]) -> Result<String, DrawError> {
    let size = if columns.len() > UPRIGHT {
        "landscape"
    } else {
        "portrait"
    };
    let print = format!("@page{{size:A4 {size};margin:9mm}}");
    let sectors = columns.iter().any(|c| !c.sectors.is_empty());
    let histograms = histograms(implant, columns)?;
    let slices = slices(columns)?;
    let main = html! {
        h1 { "Dose of a permanent implant (AAPM TG-137)" }
        (head(implant, columns))
        div class=[(columns.len() <= UPRIGHT).then_some("two")] {
            div { h2 { "Figures" } (figures(&rows(implant, columns), columns)) }
            @if sectors {
                div { h2 { "Sectors of the target: D90 (Gy) and V100 (%)" } (of_sectors(columns)) (fits(columns)) (slices) }
            }
        }
        @if let [first, .., last] = columns {
            h2 { "Dose-volume histograms: " (last.name) " solid, " (first.name) " dashed" }
        } @else {
            h2 { "Dose-volume histograms" }
        }
        (PreEscaped(histograms))
        footer {
            @for line in DEFINITIONS { p { (line) } }
            p { (super::sectors::CUTS) }
            p { (Response::PROSTATE.words()) ". " (Response::LATE.words()) "." }
            p { "Made by a simulator for research and training. Not a medical device: no treatment may rest on it." }
        }
    };
    Ok(stylet_report::page(
        &format!("Implant: {}", printable(&implant.title)),
        &format!("{SHEET}{print}"),
        &main,
    ))
}

/// Draws target, urethra and rectum of the last state, and dashed of the first one.
fn histograms(implant: &Implant, columns: &[Column]) -> Result<String, DrawError> {
    let organs = |column: &Column| {
        let organ = |organ| column.organ(organ).cloned();
        [column.target().cloned(), organ(Organ::Urethra), organ(Organ::Rectum)]
    };
    let (first, last) = (columns.first().map(organs), columns.last().map(organs));
    let (first, last) = (first.unwrap_or_default(), last.unwrap_or_default());
    let pairs = ["target", "urethra", "rectum"].into_iter().zip(last.iter().zip(&first));
    let curves = pairs.filter_map(|(name, (last, first))| {
        Some(Curve {
            name,
            dvh: last.as_ref()?,
            planned: first.as_ref().filter(|_| columns.len() > 1),
        })
    });
    stylet_dose::picture::dvh(HISTOGRAMS, &curves.collect::<Vec<_>>(), implant.prescription_gy)
}

/// Draws the middle plane of the first and the last state.
fn slices(columns: &[Column]) -> Result<Markup, DrawError> {
    let still: Vec<&Column> = columns.iter().filter(|c| !c.swells).collect();
    let ends = [still.first(), still[1.min(still.len())..].last()];
    let drawn = ends
        .into_iter()
        .flatten()
        .filter_map(|c| Some((c.name.as_str(), c.slice.as_ref()?)));
    let pictures: Vec<(&str, String)> = drawn
        .map(|(name, slice)| Ok((name, slice.picture(SLICE)?)))
        .collect::<Result<_, DrawError>>()?;
    Ok(html! {
        @if !pictures.is_empty() {
            h2 { "Middle plane of the target" }
            div class="slices" { @for (name, picture) in &pictures { div { p { (name) } (PreEscaped(picture)) } } }
            div class="key" {
                span { i class="line" {} "outline" }
                @for (level, style) in Slice::legend() { span { i class="line" style=(style) {} (level) } }
                span { "● seed in the plane" }
            }
        }
    })
}

fn head(implant: &Implant, columns: &[Column]) -> Markup {
    let source = &implant.source;
    html! {
        p {
            (printable(&implant.title)) " · prescription " (format!("{:.0} Gy", implant.prescription_gy)) " · source "
            (printable(&source.model)) " (" (printable(&source.nuclide))
            (format!(", half-life {:.2} days)", s_to_days(source.half_life_s))) " · strengths " (printable(&implant.calibrated))
            " · " (format::local_now())
            @if let Some(edema) = implant.edema { " · edema " (edema.to_string()) }
        }
        @for column in columns.iter().filter(|c| !c.swells) {
            p { b { (column.state.name) } ": seeds of " (printable(&column.state.file)) ", " (printable(&column.state.structures_are)) }
        }
    }
}

fn names(columns: &[Column]) -> Markup {
    html! { @for column in columns { th { (column.name) } } }
}

fn figures(rows: &[Row], columns: &[Column]) -> Markup {
    let begins = |n: usize| n == 0 || rows[n - 1].group != rows[n].group;
    let reasons = reasons(rows);
    html! {
        table class="limits" {
            thead { tr { th { "" } th { "" } th { "limit" } @for column in columns { th colspan="2" { (column.name) } } } }
            tbody {
                @for (n, row) in rows.iter().enumerate() {
                    @if begins(n) {
                        tr class="group" { td colspan=(3 + 2 * columns.len()) { (row.group) } }
                    }
                    tr {
                        td { (row.name) } td { (row.unit) }
                        td { @if let Some(limit) = row.limit { (limit.to_string()) } }
                        (cells(row, &reasons))
                    }
                }
            }
        }
        @for (n, why) in reasons.iter().enumerate() {
            p class="why" { sup { (n + 1) } " not computed: " (why.to_string()) }
        }
    }
}

/// Returns the reason why no column has this figure, if it is the same for all.
fn lacked_by_all(row: &Row) -> Option<&NotComputed> {
    let first = row.values.first()?.as_ref().err()?;
    row.values.iter().all(|v| v.as_ref() == Err(first)).then_some(first)
}

/// Returns the reasons why some columns lack a figure that others have, each once, for the notes
/// under the table.
fn reasons(rows: &[Row]) -> Vec<&NotComputed> {
    let mut reasons = Vec::new();
    let lacking = rows.iter().filter(|row| lacked_by_all(row).is_none());
    for why in lacking.flat_map(|row| &row.values).filter_map(|v| v.as_ref().err()) {
        if !reasons.contains(&why) {
            reasons.push(why);
        }
    }
    reasons
}

fn cells(row: &Row, reasons: &[&NotComputed]) -> Markup {
    let note = |why: &NotComputed| reasons.iter().position(|r| *r == why).map(|n| n + 1);
    html! {
        @if let Some(why) = lacked_by_all(row) {
            td class="why" colspan=(2 * row.values.len()) { "not computed: " (why.to_string()) }
        } @else {
            @for value in &row.values {
                @match value {
                    Ok(value) => {
                        td { (shown(*value, row.limit, row.digits)) }
                        @let is_bad = row.limit.is_some_and(|limit| !limit.is_met(*value));
                        td.v.bad[is_bad] { @if let Some(limit) = row.limit { (limit.verdict(*value)) } }
                    },
                    Err(why) => { td { "–" @if let Some(n) = note(why) { sup { (n) } } } td.v {} },
                }
            }
        }
    }
}

fn of_sectors(columns: &[Column]) -> Markup {
    let first = columns.first().map_or(&[][..], |c| &c.sectors);
    let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |v| format!("{v:.0}"));
    html! {
        table {
            thead { tr { th { "" } th { "cc" } (names(columns)) } }
            tbody {
                @for (n, sector) in first.iter().enumerate() {
                    tr {
                        td { (sector.name) } td { (format!("{:.1}", sector.volume_m3 * 1e6)) }
                        @for s in columns.iter().filter_map(|c| c.sectors.get(n)) {
                            td { (number(s.d90_gy)) " · " (number(s.v100.map(|v| v * 100.0))) }
                        }
                    }
                }
            }
        }
    }
}

fn fits(columns: &[Column]) -> Markup {
    let fitted = || {
        columns
            .iter()
            .filter(|c| !c.swells)
            .filter_map(|c| Some((c, c.state.fit.as_ref()?)))
    };
    html! {
        @if fitted().next().is_some() {
            h2 { "Fit of the seeds to the plan" }
            table {
                thead { tr { th { "" } th { "pairs" } th { "mean" br; "(mm)" } th { "worst" br; "(mm)" } th { "turn" br; "(°)" } th { "extent" } } }
                tbody {
                    @for (column, fit) in fitted() {
                        tr {
                            td { (column.state.name) } td { (fit.residuals_m.len()) }
                            td { (format!("{:.1}", fit.residual_figures_m()[0] * 1e3)) }
                            td { (format!("{:.1}", fit.residual_figures_m()[2] * 1e3)) }
                            td { (format!("{:.1}", fit.turn_deg())) } td { (format!("{:.3}", fit.stretch)) }
                        }
                    }
                }
            }
            p { "Seeds paired one to one for the least sum of squares; extent: that of the seeds over that of the plan." }
        }
    }
}
