//! RT Plan of a permanent implant: the sources, and the place of each seed.

mod permanent;
mod prescription;
mod read;
mod setups;
mod write;

pub use jiff::civil::Date;
pub use read::of;
pub use write::bytes;

use super::Identity;
use crate::error::FileError;
use crate::progress::Progress;
use crate::report::report;
use std::path::Path;

/// Plan in the patient frame (RAS, m); each strength in U on its own reference day.
#[derive(Clone, Debug, PartialEq)]
pub struct SeedPlan {
    /// Label of the plan.
    pub label: String,
    /// Patient, study and frame of reference.
    pub identity: Identity,
    /// SOP instance UID of the file; a dose refers to it.
    pub uid: String,
    /// Structure set of the plan.
    pub structure_set: Option<PlannedOn>,
    /// Prescribed dose, in Gy.
    pub prescription_gy: Option<f64>,
    /// Day of the plan itself.
    pub planned_on: Option<Date>,
    /// Model of all seeds.
    pub source: PlanSource,
    /// The seeds.
    pub seeds: Vec<PlanSeed>,
    /// Remarks on the reading for the user.
    pub notes: Vec<String>,
}

/// Structure set of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedOn {
    /// SOP instance UID of the structure set.
    pub uid: String,
    /// Number of the structure of the prescription.
    pub target: Option<usize>,
}

/// Model of all seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanSource {
    /// Name of the model.
    pub model: String,
    /// Manufacturer.
    pub manufacturer: String,
    /// Isotope in DICOM notation: I-125.
    pub isotope: String,
    /// Half-life, in days.
    pub half_life_days: f64,
    /// Active length, in m.
    pub active_length_m: f64,
}

/// Seed of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanSeed {
    /// Number of its needle, from 1.
    pub needle: Option<u32>,
    /// The needle's hole in the template, or another name in the plan; empty without a name.
    pub hole: String,
    /// Place (RAS), in m.
    pub position_m: [f64; 3],
    /// Unit vector.
    pub axis: Option<[f64; 3]>,
    /// Air kerma strength, in U.
    pub strength_u: f64,
    /// Reference day of the strength.
    pub strength_on: Option<Date>,
}

/// Reads the DICOM plan in the file at `path`.
pub fn of_file(path: &Path) -> Result<SeedPlan, FileError> {
    let refused = |why| FileError::of(path, why);
    let bytes = crate::bytes::whole(path, &Progress::default()).map_err(refused)?;
    super::read(&bytes).and_then(|object| of(&object)).map_err(refused)
}

/// Like [`of_file`]; prints the notes to standard error.
pub fn open(path: &Path) -> Result<SeedPlan, FileError> {
    let plan = of_file(path)?;
    report(path, &plan.notes);
    Ok(plan)
}

#[cfg(test)]
pub(super) mod tests;
