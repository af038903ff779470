//! The command `host-ui dicom`: structure set, plan and dose of one study as linked DICOM files.

use super::CommandError;
use super::dose::common::{Common, Loaded, within};
use super::dose::{POINTS_FOR_DOSE, grid};
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};
use stylet_base::output::new_folder;
use stylet_base::progress_bar::LongTask;
use stylet_dose::Dvh;
use stylet_files::dicom::images::{self, Slice};
use stylet_files::dicom::plan::SeedPlan;
use stylet_files::dicom::structures::StructureSet;
use stylet_files::dicom::structures::write::{Outlined, of_set, of_voxels};
use stylet_files::dicom::{self, Identity, Shared};
use stylet_files::together;
use stylet_files::{FileError, bytes, read_voxels, watched};
use stylet_implant::linked::{self, LinkedStudy};
use stylet_implant::plan::exchange::seeds_of_source;
use stylet_implant::plan::seeds;
use stylet_implant::provenance;

/// Margin of the grid around the outermost structure.
const GRID_MARGIN_M: f64 = 0.005;

const HELP: &str = "\
Writes three files that belong together into --out, a new or empty folder: structure_set.dcm, plan.dcm and dose.dcm; and study.json
with their UIDs, the inputs with their SHA-256, the version and the time.

Patient, study and frame of reference are those of --like, or else of the structure set, of the plan of the seeds, or of the images.
If none of them is DICOM, they are created once for all three files. Files of another patient or of another frame of reference are
refused.

  structure_set.dcm  the contours as drawn, or outlines of a label volume; each names its image, and all name their series
  plan.dcm           names the structure set, and in it the target; every seed with its needle and hole, strength and its date
  dose.dcm           names the plan; the grid covers all structures and 20 mm around the seeds; histograms of all structures

Examples:
  host-ui dicom --source sources/i125_6711.toml --seeds plan.toml --structures rtstruct.dcm --out study
  host-ui dicom --source sources/i125_6711.toml --seeds seeds.csv --strength-u 0.5 --structures gland.seg.nrrd \\
      --images ct_series --out study";

/// Options of `host-ui dicom`.
#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct DicomArgs {
    #[command(flatten)]
    common: Common,
    /// Seeds: CSV, a plan of host-ui (.toml), or a DICOM RT Plan; see `host-ui dose --help`
    #[arg(long, value_name = "FILE")]
    seeds: PathBuf,
    /// Structures: NIfTI-1, NRRD, MetaImage, DICOM RT Structure Set or Segmentation
    #[arg(long, value_name = "FILE")]
    structures: PathBuf,
    /// Folder with the image series of the contours [default: that of the structure set]
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
    /// DICOM file that provides patient, study and frame of reference
    #[arg(long, value_name = "FILE")]
    like: Option<PathBuf>,
    /// Side of the voxels of the dose
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    spacing_mm: f64,
}

impl DicomArgs {
    /// Executes the command.
    pub fn run(self) -> Result<(), CommandError> {
        let c = &self.common;
        within("--spacing-mm", self.spacing_mm, 0.05, 100.0)?;
        let identity = self.identity()?;
        let loaded = c.load(&self.seeds)?;
        let prescription_gy = c.prescription_gy(&loaded)?;
        let judge = c.judge(&self.structures, &loaded, POINTS_FOR_DOSE)?;
        let drawn = self.drawn()?;
        new_folder(&c.out)?;
        let task = LongTask::new(judge.points(), "points have their dose");
        let verdict = judge.judge_reporting(&loaded.kernel, &loaded.seeds, &|done| task.advance(done));
        drop(task);
        let covered = bounds_m(&drawn.structures);
        let dose = grid(&loaded.seeds, &loaded.kernel, self.spacing_mm * 1e-3, covered)?;
        let number = |name: &str| drawn.structures.iter().position(|s| s.name == name).map(|n| n + 1);
        // Structures may share a name: the first histogram with it belongs to the first of them.
        let mut left: Vec<(usize, &str)> = (1..).zip(drawn.structures.iter().map(|s| s.name.as_str())).collect();
        let mut histograms: Vec<(usize, &Dvh)> = Vec::new();
        for (name, dvh) in judge.names().zip(&verdict.dvhs) {
            if let Some(at) = left.iter().position(|(_, of)| *of == name) {
                histograms.push((left.remove(at).0, dvh));
            }
        }
        let target = number(judge.target_name());
        let mut inputs: Vec<(&str, &Path)> = vec![
            ("--source", c.source()?),
            ("--seeds", &self.seeds),
            ("--structures", &self.structures),
        ];
        inputs.extend(self.like.as_deref().map(|file| ("--like", file)));
        inputs.extend(self.images.as_deref().map(|folder| ("--images", folder)));
        let record = json!({ "dose_spacing_mm": self.spacing_mm, "made": provenance::made(&inputs)? });
        let study = LinkedStudy {
            plan: plan(&loaded, &identity, prescription_gy),
            identity,
            images: drawn.images,
            structures: drawn.structures,
            target,
            dose: &dose,
            histograms,
            prescription_gy,
        };
        let written = linked::write(&c.out, study, record)?;
        print!("{}", stylet_base::format::printable_table(&judge.table(&verdict)));
        for file in &written {
            println!("written: {}", file.display());
        }
        Ok(())
    }

    /// Returns the structures as contours, with their images.
    fn drawn(&self) -> Result<Drawn, CommandError> {
        let path = &self.structures;
        let refused = |why| FileError::of(path, why);
        let content = watched(path, |progress| bytes::whole(path, progress)).map_err(refused)?;
        let Some(object) = dicom::drawn(&content).map_err(refused)? else {
            let mut voxels = watched(path, |progress| read_voxels(path, progress))?;
            seeds::report(path, voxels.frame.warning.as_slice());
            voxels.names.extend(self.common.label_names()?);
            let images = match &self.images {
                Some(folder) => one_series(folder)?,
                None => Vec::new(),
            };
            return Ok(Drawn {
                structures: of_voxels(&voxels).map_err(refused)?,
                images,
            });
        };
        let set = StructureSet::of(&object).map_err(refused)?;
        let images = match &self.images {
            Some(folder) => one_series(folder)?,
            None => {
                let identity = Identity::of(&object);
                let found = images::find(bytes::folder(path), &set.series, &set.images, &identity);
                let (images, notes) = found.map_err(refused)?;
                seeds::report(path, &notes);
                images
            }
        };
        Ok(Drawn {
            structures: of_set(set),
            images,
        })
    }

    /// Returns the identity of the first file that has one; all others must agree with it.
    fn identity(&self) -> Result<Identity, CommandError> {
        let files = [Some(&*self.structures), Some(&*self.seeds), self.images.as_deref()];
        Ok(identity_of(self.like.as_deref(), &files)?
            .unwrap_or_default()
            .completed())
    }
}

/// Returns the identity of --like, else that of the first file that has one; files of two patients or frames are
/// refused.
pub fn identity_of(like: Option<&Path>, files: &[Option<&Path>]) -> Result<Option<Identity>, CommandError> {
    if let Some(like) = like
        && Identity::of_path(like)?.is_none()
    {
        return Err(format!("{}: it names no patient; --like needs a DICOM file", like.display()).into());
    }
    Ok(together(&[&[like][..], files].concat(), Shared::Frame)?)
}

/// Structures with their images.
struct Drawn {
    structures: Vec<Outlined>,
    images: Vec<Slice>,
}

/// Returns the images of a folder, which must be of one series.
fn one_series(folder: &Path) -> Result<Vec<Slice>, CommandError> {
    let slices = images::all_in(folder).map_err(|why| FileError::of(folder, why))?;
    let Some(first) = slices.first() else {
        return Err(format!(
            "{}: it contains no image series; choose another folder",
            folder.display()
        )
        .into());
    };
    let other = slices.iter().find(|slice| slice.series != first.series);
    if other.is_some() {
        return Err(format!(
            "{}: it contains images of several series; keep those of one",
            folder.display()
        )
        .into());
    }
    Ok(slices)
}

/// Returns the box around every corner of a contour.
fn bounds_m(structures: &[Outlined]) -> Option<([f64; 3], [f64; 3])> {
    let corners: Vec<[f64; 3]> = structures
        .iter()
        .flat_map(|s| s.contours.iter().flatten())
        .map(|corner| (*corner).into())
        .collect();
    let (low, high) = stylet_dose::structure::bounds(&corners);
    let margin = |v: f64, by: f64| v + by;
    (!corners.is_empty()).then(|| {
        (
            low.map(|v| margin(v, -GRID_MARGIN_M)),
            high.map(|v| margin(v, GRID_MARGIN_M)),
        )
    })
}

fn plan(loaded: &Loaded, identity: &Identity, prescription_gy: f64) -> SeedPlan {
    let (rows, prescription_gy) = (loaded.rows.clone(), Some(prescription_gy));
    SeedPlan {
        planned_on: loaded.declared.as_ref().and_then(|d| d.planned_on),
        ..seeds_of_source(&loaded.source, rows, prescription_gy, identity.clone())
    }
}
