//! TG-43 tables in spreadsheets that were saved as text: the consensus sheets of ESTRO and AAPM, and
//! others with the same headings.
//!
//! Tables are found by their headings, wherever they stand: `L =` with its unit, cGy/(h U) for Λ or
//! cm for the active length; `r (cm)` beside `gL(r)`; `Theta/deg` or `q (º)` beside the radii of
//! F; `z / cm` beside the distances of the table of dose rates.

use super::read::{Anisotropy1d, Anisotropy2d, Problems, Radial, SourceFile};
use super::{Model, Reference, Source};
use crate::along_away::{AlongAway, Comparison};
use crate::error::DoseError;
use cells::{Cells, Grid};

mod cells;

/// Description of a source that its sheets do not give.
#[derive(Default)]
pub struct Given {
    /// Name, nuclide, half-life and capsule; Λ and the active length come from the sheets.
    pub model: Model,
    /// Publication of the sheets.
    pub reference: Reference,
    /// Λ in cGy/h for 1 U, instead of that of the sheets.
    pub dose_rate_constant: Option<f64>,
    /// Active length in cm, instead of that of the sheets.
    pub active_length_cm: Option<f64>,
}

/// Imported source.
#[derive(Debug)]
pub struct Imported {
    /// Text of the source file.
    pub text: String,
    /// The source as its file gives it.
    pub source: Source,
    /// Comparison of its dose rates with those of the sheets.
    pub comparison: Option<Comparison>,
    /// Remarks for the user: what was left out, filled in or assumed.
    pub notes: Vec<String>,
}

/// Reads the sheets of one source; the error lists every problem in them.
pub fn import(sheets: &[String], given: Given) -> Result<Imported, DoseError> {
    let cells: Vec<Cells> = sheets.iter().map(|text| Cells::of(text)).collect();
    let (mut problems, mut notes) = (Problems::default(), Vec::new());
    let mut model = given.model;
    let lambda = one(
        "value of the dose rate constant",
        &cells,
        Cells::constants,
        &mut problems,
    );
    let length = one("value of the active length", &cells, Cells::lengths, &mut problems);
    model.dose_rate_constant = chosen(
        "dose rate constant, cGy/(h U)",
        given.dose_rate_constant,
        lambda,
        &mut notes,
        &mut problems,
    );
    model.active_length_cm = chosen(
        "active length, cm",
        given.active_length_cm,
        length,
        &mut notes,
        &mut problems,
    );
    let g = one("table of g(r)", &cells, |cells| cells.radial(), &mut problems);
    let radial = radial(g, &model, &mut notes, &mut problems);
    let f = one("table of F(r, theta)", &cells, Cells::anisotropy, &mut problems);
    let anisotropy_2d = f.and_then(|grid| anisotropy(grid, &mut notes, &mut problems));
    let rates = one("table of dose rates", &cells, Cells::along_away, &mut problems);
    problems.finish()?;
    if anisotropy_2d.is_none() {
        notes.push("there is no F(r, theta): doses of seeds with an axis cannot be computed".to_owned());
    }
    let mut file = SourceFile {
        source: model,
        reference: Some(given.reference),
        radial,
        anisotropy_1d: None,
        anisotropy_2d,
    };
    let source = file.checked()?;
    file.anisotropy_1d = phi_an(&file, &source);
    let comparison = rates.map(|grid| table_of(grid).compare(&source.tables));
    if let (Some(reference), Some(found)) = (&mut file.reference, &comparison) {
        reference.checked = Some(format!("its own table: {found}"));
    }
    notes.push(extrapolated(&file));
    let text = file.text()?.replace("], [", "],\n  [");
    Ok(Imported {
        source: Source::parse(&text)?,
        text,
        comparison,
        notes,
    })
}

impl SourceFile {
    fn text(&self) -> Result<String, DoseError> {
        toml::to_string(self).map_err(|e| DoseError::Source(format!("it cannot be written: {e}")))
    }

    fn checked(&self) -> Result<Source, DoseError> {
        Source::parse(&self.text()?)
    }
}

/// Returns the only find in all sheets.
fn one<T: PartialEq>(
    what: &str,
    cells: &[Cells],
    find: impl Fn(&Cells) -> Result<Vec<T>, DoseError>,
    problems: &mut Problems,
) -> Option<T> {
    let mut all: Vec<T> = Vec::new();
    for found in cells.iter().map(find) {
        match found {
            Ok(found) => all.extend(found),
            Err(why) => problems.add(why.to_string()),
        }
    }
    all.dedup();
    if all.len() > 1 {
        problems.add(format!("there is more than one {what}; give the sheets of one source"));
    }
    all.pop()
}

fn chosen(what: &str, given: Option<f64>, found: Option<f64>, notes: &mut Vec<String>, problems: &mut Problems) -> f64 {
    match (given, found) {
        (Some(given), Some(found)) if given != found => {
            notes.push(format!("{what}: the given {given} is used; the sheet has {found}"));
        }
        (None, None) => problems.add(format!("{what}: there is none in the sheets; give it as an option")),
        _ => {}
    }
    given.or(found).unwrap_or_default()
}

fn radial(found: Option<cells::Radial>, model: &Model, notes: &mut Vec<String>, problems: &mut Problems) -> Radial {
    let is_line = model.active_length_cm > 0.0;
    let mut radial = Radial {
        r_cm: Vec::new(),
        g_line: None,
        g_point: None,
    };
    let Some(mut found) = found else {
        problems.add("there is no table with the headings 'r (cm)' and 'gL(r)'".to_owned());
        return radial;
    };
    let geometry = if is_line { 'l' } else { 'p' };
    let column = found.column(geometry).or_else(|| found.column('('));
    let Some((heading, mut g)) = column else {
        let needed = if is_line {
            "gL(r), for the line"
        } else {
            "gP(r), for the point"
        };
        problems.add(format!(
            "g(r) is for another geometry than the active length, which needs {needed}"
        ));
        return radial;
    };
    if cells::plain(&heading).starts_with("g(") {
        notes.push(format!(
            "'{heading}' does not name its geometry; it is used for {}",
            if is_line { "the line" } else { "a point" }
        ));
    }
    if let Some(length) = cells::length_in(&heading).filter(|length| *length != model.active_length_cm) {
        notes.push(format!(
            "'{heading}' names another active length, {length} cm, than {} cm",
            model.active_length_cm
        ));
    }
    if let Some(place) = g.iter().position(Option::is_none) {
        problems.add(format!("g(r) is empty at r = {} cm", found.r_cm[place]));
        return radial;
    }
    if found.r_cm.first() == Some(&0.0) && g.len() > 1 {
        if g[0] != g[1] {
            notes.push("g(0) is left out: towards the middle g keeps its value at the least radius".to_owned());
        }
        found.r_cm.remove(0);
        g.remove(0);
    }
    let g = Some(g.into_iter().flatten().collect());
    (radial.g_line, radial.g_point) = if is_line { (g, None) } else { (None, g) };
    radial.r_cm = found.r_cm;
    radial
}

/// Returns F with radii as rows. Empty entries at either end of the radii, inside the capsule or
/// beyond the measured ones, get the value of the nearest radius.
fn anisotropy(mut grid: Grid, notes: &mut Vec<String>, problems: &mut Problems) -> Option<Anisotropy2d> {
    let mut filled = 0;
    for (row, theta) in grid.values.iter_mut().zip(&grid.rows_at) {
        let has = |value: &Option<f64>| value.is_some();
        let (Some(first), Some(last)) = (row.iter().position(has), row.iter().rposition(has)) else {
            problems.add(format!("F is empty at {theta} degrees"));
            return None;
        };
        if let Some(gap) = (first..last).find(|&i| row[i].is_none()) {
            problems.add(format!(
                "F is empty at {theta} degrees and r = {} cm, between other radii",
                grid.columns_at[gap]
            ));
            return None;
        }
        filled += first + row.len() - 1 - last;
        let (low, high) = (row[first], row[last]);
        row[..first].fill(low);
        row[last..].fill(high);
    }
    if filled > 0 {
        notes.push(format!(
            "{filled} empty entries of F have the value of the nearest radius at their angle"
        ));
    }
    if grid.columns_at.first() == Some(&0.0) && grid.columns_at.len() > 1 {
        if grid.values.iter().any(|row| row[0] != row[1]) {
            notes.push("F(0, theta) is left out: towards the middle F keeps its values at the least radius".to_owned());
        }
        grid.columns_at.remove(0);
        for row in &mut grid.values {
            row.remove(0);
        }
    }
    let of_radius = |i: usize| grid.values.iter().filter_map(|row| row[i]).collect();
    Some(Anisotropy2d {
        f: (0..grid.columns_at.len()).map(of_radius).collect(),
        r_cm: grid.columns_at,
        theta_deg: grid.rows_at,
    })
}

/// Integrates φ_an from F, at the radii that lie outside the capsule in every direction.
fn phi_an(file: &SourceFile, source: &Source) -> Option<Anisotropy1d> {
    let capsule = source.tables.capsule;
    let farthest_cm = capsule.half_length_m.hypot(capsule.radius_m) / super::M_PER_CM;
    let radii = &file.anisotropy_2d.as_ref()?.r_cm;
    let r_cm: Vec<f64> = radii.iter().copied().filter(|r| *r > farthest_cm).collect();
    let phi = |r: &f64| (source.tables.mean_over_directions(r * super::M_PER_CM) * 1e4).round() / 1e4;
    (!r_cm.is_empty()).then(|| Anisotropy1d {
        phi_an: r_cm.iter().map(phi).collect(),
        r_cm,
    })
}

fn table_of(grid: Grid) -> AlongAway {
    AlongAway {
        along_cm: grid.rows_at,
        away_cm: grid.columns_at,
        rates: grid.values.concat(),
    }
}

/// Returns the rules outside the tables, with their limits.
fn extrapolated(file: &SourceFile) -> String {
    let ends = |r: &[f64]| format!("{} to {} cm", r.first().unwrap_or(&0.0), r.last().unwrap_or(&0.0));
    let of_f = file.anisotropy_2d.as_ref().map_or_else(String::new, |f| {
        format!("; F has {} and keeps its end values", ends(&f.r_cm))
    });
    format!(
        "g has {}: nearer it keeps its first value, farther ln g follows the line through its last two{of_f}",
        ends(&file.radial.r_cm)
    )
}
