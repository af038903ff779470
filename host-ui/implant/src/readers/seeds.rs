//! Seeds from a table (CSV) or a DICOM RT Plan, detected by the content.

use super::columns::Mapped;
use super::declared::Declared;
pub use super::table::PLACE;
use super::table::{self, LineError, Row, shown};
use std::num::NonZeroU32;
use std::path::Path;
use std::str::FromStr;
use stylet_dose::Seed;
use stylet_files::dicom;
use stylet_files::dicom::plan::{PlanSeed, SeedPlan};
use stylet_files::{FileError, bytes};

const MAX_U: f64 = 1e5;
/// Columns of the direction.
pub const AXIS: [&str; 3] = ["axis_x", "axis_y", "axis_z"];
/// Columns with the certainty of a seed in a CT, which dose ignores.
pub const FOUND: [&str; 3] = ["confidence", "deviation_mm", "together"];
/// Number of bytes that distinguish a DICOM file from a table.
const START_BYTES: u64 = 160;

/// Defaults for seeds whose file omits them.
#[derive(Clone, Debug, Default)]
pub struct SeedDefaults {
    /// Air kerma strength, in U.
    pub strength_u: Option<f64>,
    /// Conversion for a column `activity_mci`.
    pub strength_per_activity_u_per_mci: Option<f64>,
    /// Meaning of the columns of a table, if the headers do not state it.
    pub columns: Vec<Mapped>,
}

/// Seeds of a file, with its declarations about all of them.
#[derive(Clone, Debug, PartialEq)]
pub struct SeedFile {
    /// Seeds with their needles; patient frame (RAS) for an RT Plan.
    pub rows: Vec<PlanSeed>,
    /// Declarations; `None` for a table, which says nothing of its source.
    pub declared: Option<Declared>,
    /// Remarks on the reading of the file.
    pub notes: Vec<String>,
}

/// Reads a table of seeds or a DICOM RT Plan, which gives the strengths itself. A table has the
/// columns
/// `x_mm,y_mm,z_mm[,axis_x,axis_y,axis_z][,strength_u|activity_mci][,strength_date][,needle][,hole]`,
/// and those of `find-seeds`. It may also have columns that state their quantity and unit, such as "Pos X (cm)", or any
/// columns that [`SeedDefaults::columns`] names. Commas, semicolons or tabs separate them.
pub fn read_seeds(path: &Path, defaults: SeedDefaults) -> Result<SeedFile, FileError> {
    let is_plan = bytes::start(path, START_BYTES).is_some_and(|start| dicom::is_dicom(&start));
    if is_plan {
        return Ok(of_plan(dicom::plan::of_file(path)?));
    }
    let known = [
        PLACE.as_slice(),
        &AXIS,
        &["strength_u", "activity_mci", "strength_date", "needle", "hole"],
        &FOUND,
    ]
    .concat();
    let row = |row: &Row| {
        Ok(PlanSeed {
            position_m: row.position_m()?,
            axis: axis(row)?,
            strength_u: strength_u(row, &defaults)?,
            needle: parsed(row, "needle", "not a whole number from 1")?.map(NonZeroU32::get),
            hole: row.text("hole").unwrap_or_default().to_owned(),
            strength_on: parsed(row, "strength_date", "not a day like 2026-10-31")?,
        })
    };
    let (rows, notes) = table::read(path, &known, &defaults.columns, row)?;
    Ok(SeedFile {
        rows,
        notes,
        declared: None,
    })
}

fn of_plan(plan: SeedPlan) -> SeedFile {
    SeedFile {
        notes: plan.notes,
        declared: Some(Declared {
            model: plan.source.model,
            isotope: plan.source.isotope,
            half_life_days: Some(plan.source.half_life_days),
            prescription_gy: plan.prescription_gy,
            planned_on: plan.planned_on,
        }),
        rows: plan.seeds,
    }
}

/// Returns a seed for dose computation.
pub fn dose_seed(seed: &PlanSeed) -> Seed {
    Seed {
        position_m: seed.position_m,
        axis: seed.axis,
        strength_u: seed.strength_u,
    }
}

fn axis(row: &Row) -> Result<Option<[f64; 3]>, LineError> {
    match row.three(AXIS)? {
        [None, None, None] => Ok(None),
        [Some(x), Some(y), Some(z)] => {
            let length = (x * x + y * y + z * z).sqrt();
            if !(1e-6..1e6).contains(&length) {
                return Err(LineError::new(format!(
                    "the axis has the length {length}; give a direction, or leave it empty"
                )));
            }
            Ok(Some([x, y, z].map(|v| v / length)))
        }
        _ => Err(LineError::new(
            "the axis is not complete; give axis_x, axis_y and axis_z, or none of them",
        )),
    }
}

/// Reads a field of another type; `what` follows a field that cannot be read.
fn parsed<T: FromStr>(row: &Row, column: &str, what: &str) -> Result<Option<T>, LineError> {
    let refused = |text: &str| LineError::new(format!("{column} is \"{}\", {what}", shown(text)));
    let parse = |text: &str| text.parse().map_err(|_| refused(text));
    row.text(column).map(parse).transpose()
}

fn strength_u(row: &Row, defaults: &SeedDefaults) -> Result<f64, LineError> {
    let strength = match (row.number("strength_u")?, row.number("activity_mci")?) {
        (Some(_), Some(_)) => return Err(LineError::new("both strength_u and activity_mci are given")),
        (Some(u), None) => Some(u),
        (None, Some(mci)) => {
            let per_mci = defaults.strength_per_activity_u_per_mci.ok_or_else(|| {
                LineError::new(
                    "activity_mci needs strength_per_activity_u_per_mci in the source file; or give strength_u",
                )
            })?;
            Some(mci * per_mci)
        }
        (None, None) => defaults.strength_u,
    };
    match strength {
        Some(u) if (0.0..=MAX_U).contains(&u) => Ok(u),
        Some(u) => Err(LineError::new(format!("a strength of {u} U; allowed are 0 to {MAX_U}"))),
        None => Err(LineError::new(
            "no strength: add a column strength_u or activity_mci, or give --strength-u",
        )),
    }
}

#[cfg(test)]
mod tests;
