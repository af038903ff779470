//! Structure set, plan and dose of one study, each of which names the others it was made from.

pub mod scene;

use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use stylet_base::write_whole;
use stylet_dose::{DoseGrid, Dvh};
use stylet_files::dicom::dose::{self, DoseImage, DoseKind, DoseOf, Histogram};
use stylet_files::dicom::images::Slice;
use stylet_files::dicom::plan::{self, PlannedOn, SeedPlan};
use stylet_files::dicom::structures::write::{self as structures, Outlined};
use stylet_files::dicom::{Identity, new_uid};
use stylet_files::{ContentError, FileError};

/// Names of the files.
const NAMES: [&str; 3] = ["structure_set.dcm", "plan.dcm", "dose.dcm"];
/// End of a histogram, in prescriptions, far above every limit.
const MOST_PRESCRIPTIONS: f64 = 10.0;
/// Most bins of a histogram: its numbers must fit into 64 KiB.
const MOST_BINS: f64 = 2000.0;

/// Content of a study. Patient frame (RAS, m).
pub struct LinkedStudy<'a> {
    /// Patient, study and frame of reference of all three.
    pub identity: Identity,
    /// Images under the structures; may be empty.
    pub images: Vec<Slice>,
    /// Structures, numbered from 1 in their order.
    pub structures: Vec<Outlined>,
    /// Number of the structure of the prescription.
    pub target: Option<usize>,
    /// Seeds; their study and structure set are replaced on writing.
    pub plan: SeedPlan,
    /// Dose of the seeds.
    pub dose: &'a DoseGrid,
    /// Histograms by the number of their structure.
    pub histograms: Vec<(usize, &'a Dvh)>,
    /// Prescribed dose, in Gy.
    pub prescription_gy: f64,
}

/// Writes the three files into a folder, and `study.json` with their UIDs and the fields of
/// `record`; returns the paths of structure set, plan and dose.
pub fn write(folder: &Path, study: LinkedStudy, mut record: Value) -> Result<[PathBuf; 3], FileError> {
    let files = NAMES.map(|name| folder.join(name));
    let uids = [new_uid(), new_uid(), new_uid()];
    let [structure_set, plan_uid, dose_uid] = &uids;
    let put_as = |path: &Path, bytes: Result<Vec<u8>, ContentError>| {
        let bytes = bytes.map_err(|why| FileError::of(path, why))?;
        let unwritable = |e: stylet_base::WriteError| ContentError::Unwritable(e.source.to_string());
        write_whole(path, &bytes).map_err(|e| FileError::of(path, unwritable(e)))
    };
    let put = |n: usize, bytes| put_as(&files[n], bytes);
    put(
        0,
        structures::bytes(&structures::Written {
            uid: structure_set,
            identity: &study.identity,
            images: &study.images,
            structures: &study.structures,
        }),
    )?;
    let plan = SeedPlan {
        identity: study.identity.clone(),
        uid: plan_uid.clone(),
        structure_set: Some(PlannedOn {
            uid: structure_set.clone(),
            target: study.target,
        }),
        ..study.plan
    };
    put(1, plan::bytes(&plan))?;
    for (key, value) in [
        ("patient_id", json!(study.identity.patient_id)),
        ("study_uid", json!(study.identity.study)),
        ("frame_of_reference_uid", json!(study.identity.frame_of_reference)),
        ("structure_set_uid", json!(structure_set)),
        ("plan_uid", json!(plan_uid)),
        ("dose_uid", json!(dose_uid)),
        ("seeds", json!(plan.seeds.len())),
        ("prescription_gy", json!(study.prescription_gy)),
        ("dose_voxels", json!(study.dose.dims())),
    ] {
        record[key] = value;
    }
    let histograms: Vec<Histogram> = study
        .histograms
        .iter()
        .map(|(number, dvh)| histogram(*number, dvh, study.prescription_gy))
        .collect();
    let image = DoseImage {
        dims: study.dose.dims(),
        origin_m: study.dose.centre_m([0; 3]),
        spacing_m: study.dose.spacing_m(),
        dose_gy: study.dose.dose_gy(),
        kind: &DoseKind::default(),
    };
    let of = DoseOf {
        uid: dose_uid,
        identity: &study.identity,
        plan: plan_uid,
        structure_set: Some(structure_set),
        histograms: &histograms,
    };
    put(2, dose::bytes(&image, &of))?;
    put_as(&folder.join("study.json"), Ok(format!("{record:#}\n").into_bytes()))?;
    Ok(files)
}

/// Returns a histogram in whole gray, or coarser if there would be too many bins.
fn histogram(structure: usize, dvh: &Dvh, prescription_gy: f64) -> Histogram {
    let most_gy = dvh.highest_gy().min(MOST_PRESCRIPTIONS * prescription_gy);
    let bin_gy = (most_gy / MOST_BINS).ceil().max(1.0);
    Histogram {
        structure,
        bin_gy,
        at_least_m3: dvh
            .bins(bin_gy, most_gy + bin_gy)
            .iter()
            .map(|bin| bin.at_least_m3)
            .collect(),
        range_gy: [dvh.lowest_gy(), dvh.mean_gy(), dvh.highest_gy()],
    }
}
