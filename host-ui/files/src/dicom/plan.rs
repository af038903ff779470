//! RT Plan of a permanent implant: the sources, and where each seed lies.

mod permanent;
mod read;
mod write;

pub use jiff::civil::Date;
pub use read::of;
pub use write::bytes;

use super::Identity;
use crate::error::FileError;
use crate::progress::Progress;
use std::path::Path;
use stylet_base::format::printable;

/// Patient frame (RAS, m); strengths in U on the day to which each of them refers.
#[derive(Clone, Debug, PartialEq)]
pub struct SeedPlan {
    /// Label of the plan.
    pub label: String,
    /// Patient, study and frame of reference.
    pub identity: Identity,
    /// Of the file itself; a dose refers to it.
    pub uid: String,
    /// The structure set that it was made on.
    pub structure_set: Option<PlannedOn>,
    /// Prescribed dose, in Gy.
    pub prescription_gy: Option<f64>,
    /// Day of the plan itself.
    pub planned_on: Option<Date>,
    /// The model of all seeds.
    pub source: PlanSource,
    /// The seeds.
    pub seeds: Vec<PlanSeed>,
    /// What the user should know about how it was read.
    pub notes: Vec<String>,
}

/// The structure set that a plan was made on.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedOn {
    /// SOP instance UID of the structure set.
    pub uid: String,
    /// Number of the structure that the prescription is for.
    pub target: Option<usize>,
}

/// The model that all seeds are of.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanSource {
    /// Name of the model.
    pub model: String,
    /// Who makes it.
    pub manufacturer: String,
    /// As DICOM has it: I-125.
    pub isotope: String,
    /// Half-life, in days.
    pub half_life_days: f64,
    /// Active length, in m.
    pub active_length_m: f64,
}

/// One seed of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanSeed {
    /// Number of the needle that brings it in, from 1.
    pub needle: Option<u32>,
    /// The needle's hole in the template, or what else the plan calls it; empty where it has no name.
    pub hole: String,
    /// Place (RAS), in m.
    pub position_m: [f64; 3],
    /// Unit vector.
    pub axis: Option<[f64; 3]>,
    /// Air kerma strength, in U.
    pub strength_u: f64,
    /// Day to which the strength refers.
    pub strength_on: Option<Date>,
}

/// The DICOM plan in the file at `path`; its notes go to standard error.
pub fn open(path: &Path) -> Result<SeedPlan, FileError> {
    let refused = |why| FileError::of(path, why);
    let bytes = crate::bytes::whole(path, &Progress::default()).map_err(refused)?;
    let plan = super::read(&bytes).and_then(|o| of(&o)).map_err(refused)?;
    for note in &plan.notes {
        eprintln!("note: {}: {}", path.display(), printable(note));
    }
    Ok(plan)
}

#[cfg(test)]
mod tests;
