//! Plans from and to files of all formats, by the file's extension.

use super::{ImplantPlan, PlanError, Template, file, seeds};
use crate::readers::{Declared, SeedDefaults};
use std::path::Path;
use stylet_anatomy::PatientFrame;
use stylet_base::input::has_ending;
use stylet_dose::Source;
use stylet_dose::decay::s_to_days;
use stylet_files::dicom::plan::{self, PlanSeed, PlanSource, SeedPlan};
use stylet_files::dicom::{Agreed, Identity, Shared, new_uid};
use stylet_files::{FileError, agreed};
use stylet_shm_schema::SceneHeader;

/// Model of the source for files that name none.
pub const USUAL_SOURCE: &str = "6711";

/// Returns the usual source and its prescription, Gy, for plans that name none.
pub fn usual() -> Result<(Source, f64), PlanError> {
    let source = Source::known(USUAL_SOURCE).ok_or(PlanError::NoUsualSource)?;
    let prescription_gy = source.prescription_gy.ok_or(PlanError::NoUsualPrescription)?;
    Ok((source, prescription_gy))
}

/// Reads a plan file (.toml), a table of seeds (.csv) or an RT Plan (.dcm), which must be of the
/// patient and frame of the scene's file; the error names the file. Also returns remarks for the user.
pub fn read(
    path: &Path,
    scene: &SceneHeader,
    scene_file: Option<&Path>,
) -> Result<(ImplantPlan, Vec<String>), PlanError> {
    let together = beside_scene(scene_file, path)?;
    let mut notes: Vec<String> = together.notes.into_iter().map(|(_, note)| note).collect();
    let patient = scene.patient();
    if has_ending(path, "toml") {
        let plan = file::read(path, &patient)?;
        let unknown = Source::named(&plan.source).err();
        notes.extend(unknown.map(|why| format!("{why}; the window shows the dose of {USUAL_SOURCE}")));
        return Ok((plan, notes));
    }
    let (usual, usual_gy) = usual()?;
    let defaults = SeedDefaults {
        strength_u: None,
        strength_per_activity_u_per_mci: usual.strength_per_activity_u_per_mci,
        columns: Vec::new(),
    };
    let mut seeds = seeds::read(path, defaults)?;
    let source = match &seeds.declared {
        Some(declared) => source_of(declared).map_err(|e| PlanError::of_file(path, e))?,
        None => usual,
    };
    let of_seeds = seeds.agree(&source, None, None);
    let (prescription_gy, of_seeds) = of_seeds.map_err(|e| PlanError::of_file(path, e))?;
    notes.extend(of_seeds);
    let prescription_gy = prescription_gy.unwrap_or(usual_gy);
    let template = Template::before(scene);
    let plan = file::import(path, seeds, &patient, template, &source.model, prescription_gy)?;
    Ok((plan, notes))
}

/// Compares a plan with the file of the scene. The core does not know of which patient its scene is, so a plan of a
/// patient beside a scene of an unknown file is reported.
pub fn beside_scene(scene_file: Option<&Path>, path: &Path) -> Result<Agreed, FileError> {
    let mut together = agreed(&[scene_file, Some(path)], Shared::Frame)?;
    if scene_file.is_none() && together.identity.is_some() {
        let note = "the file of the running scene is not known, so patient and frame of reference are not compared; load it here, \
                    or give it with --scene";
        together.notes.push((path.to_owned(), note.to_owned()));
    }
    Ok(together)
}

/// Returns the source that the plan declares, or another one of its nuclide, among those that need
/// no file.
fn source_of(declared: &Declared) -> Result<Source, PlanError> {
    let mut fitting: Vec<Source> = Source::all_known().filter(|s| declared.check(s).is_ok()).collect();
    let place = fitting.iter().position(|s| declared.is_of_model(s)).unwrap_or(0);
    if place < fitting.len() {
        return Ok(fitting.swap_remove(place));
    }
    Err(PlanError::UnknownIsotope(declared.isotope.clone()))
}

/// Writes all of the plan as .toml, its seeds as .csv or .dcm, with the patient and frame of the
/// scene's file.
pub fn write(
    path: &Path,
    plan: &ImplantPlan,
    patient: &PatientFrame,
    scene_file: Option<&Path>,
) -> Result<(), PlanError> {
    let identity = scene_file.map(Identity::of_path).transpose()?.flatten();
    let comments = identity.as_ref().map(Identity::comments).unwrap_or_default();
    let bytes = if has_ending(path, "toml") {
        let text = file::to_text(plan, patient).map_err(|e| PlanError::of_file(path, e))?;
        (comments + &text).into_bytes()
    } else if has_ending(path, "csv") {
        (comments + &file::seeds_to_csv(plan, patient)).into_bytes()
    } else if has_ending(path, "dcm") {
        let mut seeds = seed_plan(plan, patient).map_err(|e| PlanError::of_file(path, e))?;
        seeds.identity = identity.unwrap_or_default().completed();
        plan::bytes(&seeds).map_err(|e| PlanError::of_file(path, e))?
    } else {
        return Err(PlanError::of_file(path, PlanError::Ending));
    };
    Ok(stylet_base::write_whole(path, &bytes)?)
}

/// Returns the seeds of a plan in the form of an RT Plan; an error if its source is unknown.
pub fn seed_plan(plan: &ImplantPlan, patient: &PatientFrame) -> Result<SeedPlan, PlanError> {
    let source = Source::known(&plan.source).ok_or_else(|| PlanError::SourceOfRtPlan(plan.source.clone()))?;
    let prescription_gy = Some(plan.prescription_gy);
    Ok(seeds_of_source(
        &source,
        plan.rows(patient),
        prescription_gy,
        Identity::new(),
    ))
}

/// Returns seeds of a source in the form of an RT Plan, under a new UID.
pub fn seeds_of_source(
    source: &Source,
    seeds: Vec<PlanSeed>,
    prescription_gy: Option<f64>,
    identity: Identity,
) -> SeedPlan {
    SeedPlan {
        label: "Stylet".to_owned(),
        identity,
        uid: new_uid(),
        structure_set: None,
        prescription_gy,
        planned_on: None,
        source: PlanSource {
            model: source.model.clone(),
            manufacturer: String::new(),
            isotope: source.nuclide.clone(),
            half_life_days: s_to_days(source.half_life_s),
            active_length_m: source.tables.active_length_m,
        },
        seeds,
        notes: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The core does not know whose scene it runs, so a plan of one patient used to be counted in the gland of another
    /// without a word, wherever a command was not given the file of the scene.
    #[test]
    fn a_plan_is_compared_with_the_scene_or_reported() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, identity: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, format!("{identity}x_mm,y_mm,z_mm\n0,0,0\n")).unwrap();
            path
        };
        let plan = file(
            "plan.csv",
            "# dicom_patient_id: P1\n# dicom_frame_of_reference: 1.2.3.4\n",
        );
        let other = file("other.csv", "# dicom_patient_id: P2\n");
        let anonymous = file("anonymous.csv", "");
        let notes = |scene: Option<&Path>, plan: &Path| beside_scene(scene, plan).map(|agreed| agreed.notes.len());
        assert!(
            notes(Some(&other), &plan)
                .unwrap_err()
                .to_string()
                .contains("of patient \"P1\"")
        );
        assert_eq!(notes(None, &plan).unwrap(), 1);
        assert_eq!(notes(Some(&plan), &plan).unwrap(), 0);
        assert_eq!(notes(None, &anonymous).unwrap(), 0);
    }
}
