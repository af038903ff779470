//! RT Plan of a permanent implant: the sources, and where each seed lies.

mod read;
mod write;

pub use read::of;
pub use write::bytes;

use super::Identity;

/// Patient frame (RAS, m); strengths in U at the time of the plan.
#[derive(Clone, Debug, PartialEq)]
pub struct SeedPlan {
    pub label: String,
    pub identity: Identity,
    /// Of the file itself; a dose refers to it.
    pub uid: String,
    pub prescription_gy: Option<f64>,
    pub source: PlanSource,
    pub seeds: Vec<PlanSeed>,
    /// What the user should know about how it was read.
    pub notes: Vec<String>,
}

/// The model that all seeds are of.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanSource {
    pub model: String,
    pub manufacturer: String,
    /// As DICOM has it: I-125.
    pub isotope: String,
    pub half_life_days: f64,
    pub active_length_m: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct PlanSeed {
    /// Which needle or hole brings it in.
    pub needle: String,
    pub position_m: [f64; 3],
    /// Unit vector.
    pub axis: Option<[f64; 3]>,
    pub strength_u: f64,
}

/// The DICOM plan in the file at `path`; its notes go to standard error.
pub fn open(path: &std::path::Path) -> Result<SeedPlan, String> {
    let told = |why: String| format!("{}: {why}", path.display());
    let bytes = crate::open::whole(path, &crate::Progress::default()).map_err(told)?;
    let plan = super::read(&bytes).and_then(|o| of(&o)).map_err(told)?;
    plan.notes
        .iter()
        .for_each(|note| eprintln!("note: {}: {note}", path.display()));
    Ok(plan)
}

#[cfg(test)]
mod tests;
