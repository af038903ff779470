//! Seeds from any file that contains some: a plan file, a table, an RT Plan.

use super::{PlanError, file};
use crate::readers::{Declared, SeedDefaults, SeedFile, read_seeds};
use std::path::Path;
use stylet_anatomy::PatientFrame;
use stylet_base::input::has_ending;
use stylet_dose::Source;
use stylet_dose::decay::s_to_days;
pub use stylet_files::report;

/// Reads the seeds of a file in the patient's frame; a plan file is recognised by its extension, an
/// RT Plan by its content.
pub fn read(path: &Path, defaults: SeedDefaults) -> Result<SeedFile, PlanError> {
    if has_ending(path, "toml") {
        return of_plan_file(path);
    }
    Ok(read_seeds(path, defaults)?)
}

fn of_plan_file(path: &Path) -> Result<SeedFile, PlanError> {
    // Its places are the patient's, and so are those of the default frame.
    let plan = file::read(path, &PatientFrame::default())?;
    let rows = plan.rows(&PatientFrame::default());
    if rows.is_empty() {
        return Err(PlanError::of_file(path, PlanError::NoSeeds));
    }
    let source = Source::known(&plan.source);
    Ok(SeedFile {
        notes: Vec::new(),
        rows,
        declared: Some(Declared {
            isotope: source.as_ref().map_or_else(String::new, |s| s.nuclide.clone()),
            half_life_days: source.map(|s| s_to_days(s.half_life_s)),
            model: plan.source,
            prescription_gy: Some(plan.prescription_gy),
            planned_on: None,
        }),
    })
}
