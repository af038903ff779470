//! The command `host-ui dose`.

use super::CommandError;
use crate::sheet::{self, Column, Implant, State};
use clap::Args;
use common::{Common, Loaded, within};
use std::path::{Path, PathBuf};
use stylet_base::output::new_folder;
use stylet_base::progress_bar::LongTask;
use stylet_base::write_whole;
use stylet_dose::kernel::DoseKernel;
use stylet_dose::picture::Curve;
use stylet_dose::report::{Judge, Verdict};
use stylet_dose::seed::Seed;
use stylet_dose::{DoseGrid, DosePoints, picture, structure};
use stylet_files::bytes::file_name;
use stylet_files::dicom::Shared;
use stylet_files::together;
use stylet_implant::provenance;
use stylet_implant::readers::read_points;

pub use imported::Checked;

pub mod common;
mod imported;
pub mod write;

pub const POINTS_FOR_DOSE: usize = 300_000;
/// Margin of the grid around the outermost seeds.
const GRID_MARGIN_M: f64 = 0.02;

const DOSE_HELP: &str = "\
Units: positions in mm (any frame, the same for all files; structures are in patient RAS), dose in Gy, air kerma strength in U
(1 U = 1 cGy cm2/h), activity in mCi, days.

Seeds are CSV with a header; the columns in brackets may be left out, and lines that begin with # are skipped:
  x_mm,y_mm,z_mm[,axis_x,axis_y,axis_z][,strength_u or activity_mci][,strength_date][,needle][,hole]
A table of another program may have semicolons or tabs, and headers that state quantity and unit, such as Pos X (cm). Map any other
header with --column: --column x_mm=-Lateral:cm takes the column Lateral, in cm and with the opposite sign; unmapped columns are then
skipped. The meaning of each column is reported.
A plan declares the isotope of its seeds, their strength on a given day, and the prescription. Seeds of another isotope than the
source are refused, strengths decay to --implant-date, and the plan's prescription applies unless --prescription-gy is given.
A seed with an axis gets the 2D formalism, a seed without one the 1D formalism (averaged over directions).

With --rt-dose the figures are those of an imported dose: RT Dose, NRRD, NIfTI-1 or MetaImage in Gy, or dose_grid.csv. It is interpolated
at the points of each structure (cubics). The part of a structure outside of its voxels is reported and not counted; a target of which
1 % is outside is refused. With --seeds in addition, each measure of the TG-43U1 dose stands beside it: a second check.

Examples:
  host-ui dose --source sources/i125_6711.toml --seeds seeds.csv --strength-u 0.5 --points points.csv --out dose
  host-ui dose --source sources/i125_6711.toml --seeds seeds.csv --structures gland.nii.gz \\
      --name 1=Prostate --name 2=Urethra --name 3=Rectum --metric D5 --metric V145Gy --out dose
  host-ui dose --source sources/pd103_200.toml --seeds seeds.csv --from-days 0 --to-days 30 --spacing-mm 2 --out dose
  host-ui dose --rt-dose rtdose.dcm --structures rtstruct.dcm --seeds rtplan.dcm --source sources/i125_6711.toml --out check

Written to --out, a new or empty folder: dose_points.csv; dvh.csv, dvh.svg and metrics.json; without --rt-dose also report.html (one
page by TG-137, A4); dose_grid.csv when neither points nor structures are given; second_check.csv for an imported dose of seeds, whose
dvh.svg has the TG-43U1 dose dashed; made.json, which names every input with its SHA-256, the version and the time.";

#[derive(Args, Debug)]
#[command(after_long_help = DOSE_HELP, mut_arg("source", |arg| arg.required(false).required_unless_present("rt_dose")))]
pub struct DoseArgs {
    #[command(flatten)]
    common: Common,
    /// Seeds: CSV, a plan of host-ui (.toml), or a DICOM RT Plan; see --help
    #[arg(long, value_name = "FILE", required_unless_present = "rt_dose", requires = "source")]
    seeds: Option<PathBuf>,
    /// Points for the dose (CSV: x_mm,y_mm,z_mm)
    #[arg(long, value_name = "FILE")]
    points: Option<PathBuf>,
    /// Structures: NIfTI-1, NRRD, MetaImage, DICOM RT Structure Set or Segmentation
    #[arg(long, value_name = "FILE")]
    structures: Option<PathBuf>,
    /// Imported dose to evaluate in the structures: an RT Dose, or a volume in Gy
    #[arg(long, value_name = "FILE", requires = "structures")]
    rt_dose: Option<PathBuf>,
    /// Side of the voxels of the grid
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    spacing_mm: f64,
    /// Width of the bins of the histogram
    #[arg(long, value_name = "GY", default_value_t = 1.0)]
    bin_gy: f64,
}

impl DoseArgs {
    pub fn run(self) -> Result<(), CommandError> {
        let c = &self.common;
        within("--spacing-mm", self.spacing_mm, 0.05, 100.0)?;
        within("--bin-gy", self.bin_gy, 1e-3, 1e4)?;
        let clinical = [
            self.rt_dose.as_deref(),
            self.seeds.as_deref(),
            self.points.as_deref(),
            self.structures.as_deref(),
        ];
        let identity = together(&clinical, Shared::Frame)?;
        if let Some(file) = &self.rt_dose {
            return self.run_imported(file, identity.as_ref());
        }
        let seeds_file = self.seeds.as_deref().ok_or("give the seeds with --seeds FILE")?;
        let loaded = c.load(seeds_file)?;
        let (source, kernel, seeds) = (&loaded.source, &loaded.kernel, &loaded.seeds);
        let points = self.points.as_deref().map(read_points).transpose()?;
        let structures = self
            .structures
            .as_ref()
            .map(|file| c.structures(file, seeds, POINTS_FOR_DOSE))
            .transpose()?;
        let judge = structures
            .clone()
            .map(|(structures, _)| c.judge_of(structures, &loaded, &[], POINTS_FOR_DOSE))
            .transpose()?;
        new_folder(&c.out)?;
        let judged = judge.map(|judge| {
            let task = LongTask::new(
                judge.points(),
                &format!("points have their dose of {} seeds", seeds.len()),
            );
            let verdict = judge.judge_reporting(kernel, seeds, &|done| task.advance(done));
            (judge, verdict)
        });
        let mut inputs: Vec<(&str, &Path)> = vec![("--source", c.source()?), ("--seeds", seeds_file)];
        inputs.extend(self.points.as_deref().map(|file| ("--points", file)));
        inputs.extend(self.structures.as_deref().map(|file| ("--structures", file)));
        let made = provenance::made(&inputs)?;
        if let Some(points_m) = &points {
            let mut dose = DosePoints::new(points_m);
            dose.add(kernel, seeds);
            let places = points_m.iter().copied();
            write::doses(
                &c.out.join("dose_points.csv"),
                identity.as_ref(),
                places,
                dose.dose_gy(),
            )?;
        }
        if let Some((judge, verdict)) = &judged {
            self.write_histograms(judge, (verdict, None), c.prescription_gy(&loaded)?)?;
            let mut metrics = judge.to_json(verdict);
            metrics["dose"] = c.provenance(source, seeds);
            metrics["made"] = made.clone();
            write::json(&c.out.join("metrics.json"), &metrics)?;
            print!("{}", stylet_base::format::printable_table(&judge.table(verdict)));
        }
        if let Some((structures, target)) = structures {
            let implant = self.implant(seeds_file, &loaded)?;
            let state = State {
                name: "dose".to_owned(),
                file: file_name(seeds_file),
                structures_are: self.structures.as_deref().map(file_name).unwrap_or_default(),
                seen_s: 0.0,
                seeds: seeds.clone(),
                structures,
                target,
                fit: None,
            };
            let column = Column::of(&implant, kernel, state, None);
            write_whole(&c.out.join("report.html"), sheet::page(&implant, &[column])?.as_bytes())?;
        }
        if points.is_none() && judged.is_none() {
            let grid = grid(seeds, kernel, self.spacing_mm * 1e-3, None)?;
            let [nx, ny, nz] = grid.dims();
            let centres = (0..nx * ny * nz).map(|i| grid.centre_m([i % nx, i / nx % ny, i / nx / ny]));
            write::doses(&c.out.join("dose_grid.csv"), identity.as_ref(), centres, grid.dose_gy())?;
        }
        write::json(&c.out.join("made.json"), &made)?;
        println!("written: {}", c.out.display());
        Ok(())
    }
}

impl DoseArgs {
    /// Writes the histograms of a dose, and draws those of another one dashed.
    fn write_histograms(
        &self,
        judge: &Judge,
        (dose, dashed): (&Verdict, Option<&Verdict>),
        prescription_gy: f64,
    ) -> Result<(), CommandError> {
        let out = &self.common.out;
        let curves: Vec<_> = judge.names().zip(&dose.dvhs).collect();
        write::dvh(&out.join("dvh.csv"), &curves, prescription_gy, self.bin_gy)?;
        let all = curves.iter().enumerate().map(|(n, &(name, dvh))| Curve {
            name,
            dvh,
            planned: dashed.and_then(|dashed| dashed.dvhs.get(n)),
        });
        let curves: Vec<Curve> = all.collect();
        let drawn = picture::dvh((900, 560), &curves, prescription_gy)?;
        Ok(write_whole(&out.join("dvh.svg"), drawn.as_bytes())?)
    }

    fn implant(&self, seeds: &Path, loaded: &Loaded) -> Result<Implant, CommandError> {
        Ok(Implant {
            title: file_name(seeds),
            source: loaded.source.clone(),
            prescription_gy: self.common.prescription_gy(loaded)?,
            calibrated: self.common.calibrated(loaded),
            edema: None,
            is_for_ever: self.common.is_for_ever(),
        })
    }
}

/// Computes the dose on a grid around the seeds, and around a box (m) if one is given; with
/// progress.
pub fn grid(
    seeds: &[Seed],
    kernel: &DoseKernel,
    spacing_m: f64,
    covered_m: Option<([f64; 3], [f64; 3])>,
) -> Result<DoseGrid, CommandError> {
    let places: Vec<[f64; 3]> = seeds.iter().map(|s| s.position_m).collect();
    let (low, high) = structure::bounds(&places);
    let (mut low, mut high) = (low.map(|v| v - GRID_MARGIN_M), high.map(|v| v + GRID_MARGIN_M));
    if let Some((lower, upper)) = covered_m {
        low = [0, 1, 2].map(|a| low[a].min(lower[a]));
        high = [0, 1, 2].map(|a| high[a].max(upper[a]));
    }
    let mut grid = DoseGrid::covering(low, high, spacing_m)?;
    let voxels = grid.dose_gy().len() as u64;
    let task = LongTask::new(voxels, &format!("voxels have their dose of {} seeds", seeds.len()));
    grid.add_reporting(kernel, seeds, &|done| task.advance(done));
    Ok(grid)
}
