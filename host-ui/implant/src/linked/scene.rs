//! The study of a plan in a scene: outlines of the scene's structures, the plan, and the dose of
//! its seeds.

use super::{LinkedStudy, write as write_linked};
use crate::plan::{Anatomy, ImplantPlan, PlanError, exchange, file};
use crate::provenance;
use nalgebra::{Matrix3, Vector3};
use serde_json::json;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use stylet_base::output::{OutputError, new_folder};
use stylet_dose::decay::Interval;
use stylet_dose::report::Judge;
use stylet_dose::{DoseGrid, DoseKernel, Dvh, Seed, Source, structure};
use stylet_files::dicom::images::{self, Slice};
use stylet_files::dicom::segmentation::is_segmentation;
use stylet_files::dicom::structures::StructureSet;
use stylet_files::dicom::structures::write::{Outlined, of_set, of_voxels};
use stylet_files::dicom::{self, Identity};
use stylet_files::{ContentError, FileError, Progress, VoxelFrame, Voxels, bytes, read_voxels, scene as scene_file};
use stylet_host::link::SceneModel;

/// Side of a voxel of the dose.
const PITCH_M: f64 = 1e-3;
const POINTS: usize = 100_000;
/// Margin of the grid around structures and seeds.
const STRUCTURE_MARGIN_M: f64 = 5e-3;
const SEED_MARGIN_M: f64 = 20e-3;
/// Share of the dose in the whole work.
const SHARE_OF_DOSE: f32 = 0.9;
/// Number of seeds added between two checks for cancellation.
const TOGETHER: usize = 16;

/// Reason why a study was not written.
#[derive(Debug, thiserror::Error)]
pub enum SceneStudyError {
    /// The plan cannot be written as DICOM.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A file was refused or cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The structures cannot be outlined.
    #[error("the structures of the scene: {0}")]
    Structures(#[from] ContentError),
    /// The dose cannot be computed or counted.
    #[error("the dose of the plan: {0}")]
    Dose(#[from] stylet_dose::DoseError),
    /// The folder exists and is not empty, or cannot be created.
    #[error(transparent)]
    Folder(#[from] OutputError),
    /// The work was cancelled.
    #[error("the study was cancelled; nothing was written")]
    Cancelled,
}

/// Writes `structure_set.dcm`, `plan.dcm`, `dose.dcm` and `study.json` into a new or empty folder,
/// and returns the remarks on them. Patient, study, frame of reference, contours and images are
/// those of `like` if it is a DICOM structure set; otherwise the structures are outlined along the
/// cells of the scene, and a file such as NRRD may still name the patient. `report` gets the completed share; if it breaks, nothing is written.
///
/// # Errors
///
/// An unknown source, a plan without seeds, a file that cannot be written.
pub fn write(
    folder: &Path,
    plan: &ImplantPlan,
    (scene, anatomy): (&SceneModel, &Anatomy),
    like: Option<&Path>,
    report: &dyn Fn(f32) -> ControlFlow<()>,
) -> Result<Vec<String>, SceneStudyError> {
    let proceed = |share: f32| match report(share) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(SceneStudyError::Cancelled),
    };
    let patient = scene.header.patient();
    let (of_plan, source) = (exchange::seed_plan(plan, &patient)?, known(plan)?);
    let kernel = DoseKernel::new(&source, Interval::ALL);
    proceed(0.0)?;
    let (drawn, mut notes) = match like.map(of_file).transpose()?.flatten() {
        Some(mut drawn) => {
            let notes = std::mem::take(&mut drawn.notes);
            (drawn, notes)
        }
        None => {
            let (identity, notes) = identity(like)?;
            let drawn = Drawn {
                structures: of_voxels(&voxels(scene)?)?,
                identity,
                images: Vec::new(),
                notes: Vec::new(),
            };
            (drawn, notes)
        }
    };
    proceed(0.02)?;
    let in_patient = |seed: Seed| Seed {
        position_m: patient.patient_from_scene(seed.position_m),
        axis: seed.axis.map(|axis| patient.patient_from_scene_direction(axis)),
        ..seed
    };
    let seeds: Vec<Seed> = plan.seeds().into_iter().map(in_patient).collect();
    let judge = Judge::new(
        anatomy.structures(),
        Some(&anatomy.target.name),
        &[],
        plan.prescription_gy,
        &plan.seeds(),
        POINTS,
    )?;
    let verdict = judge.judge(&kernel, &plan.seeds());
    proceed(0.05)?;
    let mut dose = grid(&seeds, &drawn.structures)?;
    // Sums of doses are exact, so the order in which seeds are added does not matter.
    let parts = seeds.len().div_ceil(TOGETHER);
    for (n, part) in seeds.chunks(TOGETHER).enumerate() {
        dose.add(&kernel, part);
        proceed(0.05 + SHARE_OF_DOSE * (n + 1) as f32 / parts as f32)?;
    }
    let number = |name: &str| drawn.structures.iter().position(|s| s.name == name).map(|n| n + 1);
    let histograms: Vec<(usize, &Dvh)> = judge
        .names()
        .zip(&verdict.dvhs)
        .filter_map(|(name, dvh)| Some((number(name)?, dvh)))
        .collect();
    let target = number(&anatomy.target.name);
    if target.is_none() {
        notes.push(format!("the target {} is not among the contours", anatomy.target.name));
    }
    new_folder(folder)?;
    let text = file::to_text(plan, &patient)?;
    let record = json!({
        "scene": scene.header.name.read(),
        "made": provenance::made_of(&[
            ("labels of the scene", &scene.labels),
            ("plan", text.as_bytes()),
            ("model of the source", source.model.as_bytes()),
        ]),
    });
    let study = LinkedStudy {
        identity: drawn.identity,
        images: drawn.images,
        structures: drawn.structures,
        target,
        plan: of_plan,
        dose: &dose,
        histograms,
        prescription_gy: plan.prescription_gy,
    };
    write_linked(folder, study, record)?;
    // The files are written; there is nothing left to cancel.
    let _ = report(1.0);
    Ok(notes)
}

/// Returns the identity of a file that is not DICOM, or a new one with a remark.
fn identity(like: Option<&Path>) -> Result<(Identity, Vec<String>), FileError> {
    Ok(match like.map(Identity::of_path).transpose()?.flatten() {
        Some(identity) => (identity.completed(), Vec::new()),
        None => (
            Identity::new(),
            vec!["patient, study and frame of reference are new".to_owned()],
        ),
    })
}

fn known(plan: &ImplantPlan) -> Result<Source, PlanError> {
    Source::named(&plan.source).map_err(PlanError::UnknownSource)
}

/// Structures with their images and identity.
struct Drawn {
    structures: Vec<Outlined>,
    identity: Identity,
    images: Vec<Slice>,
    notes: Vec<String>,
}

/// Reads the contours of a structure set or outlines of a segmentation, or of those that a scene
/// file names; `None` for any other file.
fn of_file(path: &Path) -> Result<Option<Drawn>, SceneStudyError> {
    let named = match scene_file::is_scene(path) {
        true => Some(path.with_file_name(scene_file::read(path)?.volume)),
        false => None,
    };
    let path = named.as_deref().unwrap_or(path);
    let refused = |why| FileError::of(path, why);
    let content = bytes::whole(path, &Progress::default()).map_err(refused)?;
    if !dicom::is_dicom(&content) {
        return Ok(None);
    }
    let object = dicom::read(&content).map_err(refused)?;
    if is_segmentation(&object.sop_class) {
        let voxels = read_voxels(path, &Progress::default())?;
        return Ok(Some(Drawn {
            structures: of_voxels(&voxels)?,
            identity: Identity::of(&object).completed(),
            images: Vec::new(),
            notes: voxels.frame.warning.into_iter().collect(),
        }));
    }
    let set = StructureSet::of(&object).map_err(refused)?;
    let identity = Identity::of(&object);
    let found = images::find(bytes::folder(path), &set.series, &set.images, &identity);
    let (images, found_notes) = found.map_err(refused)?;
    let notes = [set.notes.clone(), found_notes].concat();
    Ok(Some(Drawn {
        images,
        identity: identity.completed(),
        structures: of_set(set),
        notes,
    }))
}

/// Returns the cells of a scene as a volume of the patient.
fn voxels(scene: &SceneModel) -> Result<Voxels, SceneStudyError> {
    let (header, labels) = (&scene.header, &scene.header.labels);
    let patient = header.patient();
    let columns_m: Matrix3<f64> = patient.rotation() * labels.spacing_m;
    let origin_m = Vector3::from(patient.patient_from_scene(labels.origin_m));
    let names: BTreeMap<u8, String> = (1_u8..=255)
        .zip(header.structures().iter().map(|structure| structure.name.read()))
        .collect();
    Ok(Voxels {
        dims: labels.dims.map(|d| d as usize),
        labels: scene.labels.clone(),
        frame: VoxelFrame::new(columns_m, origin_m, "scene")?,
        names,
        also: Vec::new(),
        overlap: None,
    })
}

/// Creates a grid around all structures and seeds, without dose.
fn grid(seeds: &[Seed], structures: &[Outlined]) -> Result<DoseGrid, SceneStudyError> {
    let corners: Vec<[f64; 3]> = structures
        .iter()
        .flat_map(|structure| structure.contours.iter().flatten())
        .map(|corner| (*corner).into())
        .collect();
    let places: Vec<[f64; 3]> = seeds.iter().map(|seed| seed.position_m).collect();
    let boxes = [
        (structure::bounds(&corners), STRUCTURE_MARGIN_M),
        (structure::bounds(&places), SEED_MARGIN_M),
    ];
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for ((lower, upper), margin_m) in boxes {
        for a in 0..3 {
            low[a] = low[a].min(lower[a] - margin_m);
            high[a] = high[a].max(upper[a] + margin_m);
        }
    }
    Ok(DoseGrid::covering(low, high, PITCH_M)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A study of a scene from NRRD used to be of a new patient, although the file names its own.
    #[test]
    fn a_study_keeps_the_patient_of_the_scenes_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("gland.nrrd");
        let own = Identity {
            patient_id: "P1".to_owned(),
            frame_of_reference: "1.2.3.4".to_owned(),
            ..Identity::default()
        };
        std::fs::write(&path, format!("NRRD0005\n{}\n", own.pairs())).unwrap();
        let (kept, notes) = identity(Some(&path)).unwrap();
        assert_eq!([&kept.patient_id, &kept.frame_of_reference], ["P1", "1.2.3.4"]);
        assert!(notes.is_empty());
        std::fs::write(&path, "NRRD0005\n\n").unwrap();
        assert_eq!(identity(Some(&path)).unwrap().1.len(), 1);
    }
}
