//! `host-ui dose` and `host-ui perturb`.

use super::CommandError;
use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stylet_base::interrupt::Interrupt;
use stylet_base::progress_bar::progress_bar;
use stylet_dose::decay::{Interval, days_to_s, left_after};
use stylet_dose::kernel::DoseKernel;
use stylet_dose::metric::Metric;
use stylet_dose::report::Judge;
use stylet_dose::seed::Seed;
use stylet_dose::source::Source;
use stylet_dose::structure::Structure;
use stylet_dose::{DoseGrid, DosePoints, perturb, picture, structure};
use stylet_files::dicom::plan::Date;
use stylet_implant::plan::seeds;
use stylet_implant::readers::{DayOfImplant, SeedDefaults, contours, labels, read_points};

mod write;

const POINTS_FOR_DOSE: usize = 300_000;
const POINTS_FOR_A_TRIAL: usize = 40_000;
/// The grid reaches this far beyond the outermost seeds.
const GRID_MARGIN_M: f64 = 0.02;
const MAX_TRIALS: u64 = 1_000_000;

const DOSE_HELP: &str = "\
Units: positions in mm (any frame, the same for all files; structures are in patient RAS), dose in Gy, air kerma strength in U
(1 U = 1 cGy cm2/h), activity in mCi, days.

Seeds are CSV with a header; the columns in brackets may be left out, and lines that begin with # are skipped:
  x_mm,y_mm,z_mm[,axis_x,axis_y,axis_z][,strength_u or activity_mci][,needle][,hole]
A plan says itself which isotope its seeds are of, how strong they are on which day, and what is prescribed: seeds of another
isotope than the source are refused, strengths decay to --implant-date, and its prescription counts unless another is asked for.
A seed with an axis gets the 2D formalism, a seed without one the 1D formalism (averaged over directions).

Examples:
  host-ui dose --source sources/i125_6711.toml --seeds seeds.csv --strength-u 0.5 --points points.csv --out dose
  host-ui dose --source sources/i125_6711.toml --seeds seeds.csv --structures gland.nii.gz \\
      --name 1=Prostate --name 2=Urethra --name 3=Rectum --metric D5 --metric V145Gy --out dose
  host-ui dose --source sources/pd103_200.toml --seeds seeds.csv --from-days 0 --to-days 30 --spacing-mm 2 --out dose

Written to --out: dose_points.csv; dvh.csv, dvh.svg and metrics.json; dose_grid.csv when neither points nor structures are given.";

const PERTURB_HELP: &str = "\
Every trial moves each seed by a normal error of --sigma-mm along x, y and z, keeps its axis and strength, and computes all metrics
again. The same --seed gives the same trials on any number of cores. Ctrl-C ends early and writes the trials done so far.

Example, with the settings of published studies (4 mm, 1000 trials); its figures are those of your plan:
  host-ui perturb --source sources/i125_6711.toml --plan seeds.csv --strength-u 0.5 --structures gland.nii.gz \\
      --name 1=Prostate --name 2=Urethra --name 3=Rectum --sigma-mm 4 --trials 1000 --out perturb

Written to --out: trials.csv (one line a trial), distribution.csv and distribution.json (planned, mean, sd, p5 to p95).";

#[derive(Args, Debug)]
struct Common {
    /// Source file (TOML) as those in sources/
    #[arg(long, value_name = "FILE")]
    source: PathBuf,
    /// Strength in U of seeds whose file gives none
    #[arg(long, value_name = "U")]
    strength_u: Option<f64>,
    /// The strengths were measured this many days before the implant, and have decayed since
    #[arg(long, value_name = "DAYS", default_value_t = 0.0)]
    measured_days_before: f64,
    /// Day of the implant (2026-10-31), to which strengths with a reference date decay, as those of an RT Plan have it
    #[arg(long, value_name = "DATE", conflicts_with = "measured_days_before")]
    implant_date: Option<Date>,
    /// Count dose from this day after the implant
    #[arg(long, value_name = "DAYS", default_value_t = 0.0)]
    from_days: f64,
    /// Count dose up to this day after the implant [default: without end]
    #[arg(allow_negative_numbers = true, long, value_name = "DAYS")]
    to_days: Option<f64>,
    /// Prescribed dose in Gy [default: that of the plan, or else of the source file]
    #[arg(long, value_name = "GY")]
    prescription_gy: Option<f64>,
    /// What a label is called: 1=Prostate; may be given again
    #[arg(long = "name", value_name = "LABEL=NAME")]
    names: Vec<String>,
    /// Structure that the prescription is for [default: the one named PTV, CTV, prostate, gland, ..., or the lowest label]
    #[arg(long, value_name = "NAME")]
    target: Option<String>,
    /// One more metric of every structure: D90, D2cc, V150, V145Gy, Dmean, Dmax, Dmin; may be given again
    #[arg(long = "metric", value_name = "METRIC")]
    metrics: Vec<String>,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Args, Debug)]
#[command(after_long_help = DOSE_HELP)]
pub struct DoseArgs {
    #[command(flatten)]
    common: Common,
    /// Seeds: CSV, a plan of host-ui (.toml), or a DICOM RT Plan; see --help
    #[arg(long, value_name = "FILE")]
    seeds: PathBuf,
    /// Points to take the dose at (CSV: x_mm,y_mm,z_mm)
    #[arg(long, value_name = "FILE")]
    points: Option<PathBuf>,
    /// Structures: NIfTI-1, NRRD, MetaImage or a DICOM RT Structure Set
    #[arg(long, value_name = "FILE")]
    structures: Option<PathBuf>,
    /// Side of the voxels of the grid
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    spacing_mm: f64,
    /// Width of the bins of the histogram
    #[arg(long, value_name = "GY", default_value_t = 1.0)]
    bin_gy: f64,
}

#[derive(Args, Debug)]
#[command(after_long_help = PERTURB_HELP)]
pub struct PerturbArgs {
    #[command(flatten)]
    common: Common,
    /// Planned seeds: CSV, a plan of host-ui (.toml), or a DICOM RT Plan; see `host-ui dose --help`
    #[arg(long, value_name = "FILE")]
    plan: PathBuf,
    /// Structures: NIfTI-1, NRRD, MetaImage or a DICOM RT Structure Set
    #[arg(long, value_name = "FILE")]
    structures: PathBuf,
    /// Standard deviation of a seed's error along each axis
    #[arg(long, value_name = "MM", default_value_t = 4.0)]
    sigma_mm: f64,
    /// Number of trials, each with its own random errors
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=MAX_TRIALS))]
    trials: u64,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

impl DoseArgs {
    pub fn run(self) -> Result<(), CommandError> {
        let c = &self.common;
        within("--spacing-mm", self.spacing_mm, 0.05, 100.0)?;
        within("--bin-gy", self.bin_gy, 1e-3, 1e4)?;
        let loaded = c.load(&self.seeds)?;
        let (source, kernel, seeds) = (&loaded.source, &loaded.kernel, &loaded.seeds);
        let judged = self.structures.as_ref().map(|file| {
            let judge = c.judge(file, &loaded, POINTS_FOR_DOSE)?;
            let verdict = judge.judge(kernel, seeds);
            Ok::<_, CommandError>((judge, verdict))
        });
        let judged = judged.transpose()?;
        let points = self.points.as_deref().map(read_points).transpose()?;
        write::folder(&c.out)?;
        if let Some(points_m) = &points {
            let mut dose = DosePoints::new(points_m);
            dose.add(kernel, seeds);
            write::doses(&c.out.join("dose_points.csv"), points_m.iter().copied(), dose.dose_gy())?;
        }
        if let Some((judge, verdict)) = &judged {
            let prescription_gy = c.prescription_gy(&loaded)?;
            let curves: Vec<_> = judge.names().zip(&verdict.dvhs).collect();
            write::dvh(&c.out.join("dvh.csv"), &curves, prescription_gy, self.bin_gy)?;
            picture::dvh(&c.out.join("dvh.svg"), &curves, prescription_gy)?;
            let mut metrics = judge.to_json(verdict);
            metrics["dose"] = c.provenance(source, seeds);
            write::json(&c.out.join("metrics.json"), &metrics)?;
            print!("{}", judge.table(verdict));
        }
        if points.is_none() && judged.is_none() {
            let grid = grid(seeds, kernel, self.spacing_mm * 1e-3)?;
            let [nx, ny, nz] = grid.dims();
            let centres = (0..nx * ny * nz).map(|i| grid.centre_m([i % nx, i / nx % ny, i / nx / ny]));
            write::doses(&c.out.join("dose_grid.csv"), centres, grid.dose_gy())?;
        }
        println!("written: {}", c.out.display());
        Ok(())
    }
}

impl PerturbArgs {
    pub fn run(self) -> Result<(), CommandError> {
        let c = &self.common;
        within("--sigma-mm", self.sigma_mm, 0.0, 100.0)?;
        let loaded = c.load(&self.plan)?;
        let (source, kernel, plan) = (&loaded.source, &loaded.kernel, &loaded.seeds);
        let judge = c.judge(&self.structures, &loaded, POINTS_FOR_A_TRIAL)?;
        let how = perturb::Perturbation {
            sigma_m: self.sigma_mm * 1e-3,
            trials: self.trials as usize,
            random_seed: self.seed,
        };
        let stop = Interrupt::on_signals()?;
        write::folder(&c.out)?;
        let planned = judge.values(&judge.judge(kernel, plan));
        let bar = progress_bar(self.trials, "trials");
        let trials = perturb::trials(&judge, kernel, plan, how, &stop, || bar.inc(1));
        bar.finish_and_clear();
        if trials.is_empty() {
            return Err("stopped before the first trial was done; nothing is written".into());
        }
        let spreads = perturb::spreads(&planned, &trials);
        write::trials(&c.out.join("trials.csv"), &planned, &trials)?;
        write::distribution(&c.out.join("distribution.csv"), &spreads)?;
        let mut result = write::spreads_json(&spreads);
        result["dose"] = c.provenance(source, plan);
        result["sigma_mm"] = json!(self.sigma_mm);
        result["random_seed"] = json!(self.seed);
        result["trials"] = json!(trials.len());
        result["trials_asked"] = json!(self.trials);
        write::json(&c.out.join("distribution.json"), &result)?;
        print!("{}", write::spread_table(&spreads));
        if trials.len() < how.trials {
            println!("stopped after {} of {} trials", trials.len(), how.trials);
        }
        println!("written: {}", c.out.display());
        Ok(())
    }
}

/// What dose is computed from.
struct Loaded {
    source: Source,
    kernel: DoseKernel,
    seeds: Vec<Seed>,
    prescription_gy: Option<f64>,
}

impl Common {
    /// Source, dose of a seed of 1 U over the time asked for, and seeds with their strength at the implant.
    fn load(&self, path: &Path) -> Result<Loaded, CommandError> {
        within("--measured-days-before", self.measured_days_before, 0.0, 1e6)?;
        within("--from-days", self.from_days, 0.0, 1e6)?;
        if let Some(to) = self.to_days {
            within("--to-days", to, self.from_days, 1e6)?;
        }
        if let Some(u) = self.strength_u {
            within("--strength-u", u, 0.0, 1e5)?;
        }
        let source = Source::read(&self.source)?;
        let defaults = SeedDefaults {
            strength_u: self.strength_u,
            strength_per_activity_u_per_mci: source.strength_per_activity_u_per_mci,
        };
        let mut file = seeds::read(path, defaults)?;
        let day = DayOfImplant(self.implant_date);
        let agreed = file.agree(&source, self.prescription_gy, day);
        let (prescription_gy, notes) = agreed.map_err(|why| format!("{}: {why}", path.display()))?;
        seeds::report(path, &notes);
        let mut all: Vec<Seed> = file.rows.into_iter().map(|row| row.seed).collect();
        if source.tables.anisotropy_2d.is_none() && all.iter().any(|s| s.axis.is_some()) {
            return Err(format!(
                "{} has no [anisotropy_2d], which seeds with an axis need; leave the axis columns out",
                self.source.display()
            )
            .into());
        }
        if source.tables.anisotropy_1d.is_none() && all.iter().any(|s| s.axis.is_none()) {
            return Err(format!(
                "{} has no [anisotropy_1d], which seeds without an axis need; give every seed its axis",
                self.source.display()
            )
            .into());
        }
        let left = left_after(days_to_s(self.measured_days_before), source.half_life_s);
        for seed in &mut all {
            seed.strength_u *= left;
        }
        let interval = Interval::days(self.from_days, self.to_days.unwrap_or(f64::INFINITY));
        let kernel = DoseKernel::new(&source, interval);
        Ok(Loaded {
            source,
            kernel,
            seeds: all,
            prescription_gy,
        })
    }

    fn prescription_gy(&self, loaded: &Loaded) -> Result<f64, CommandError> {
        let gy = loaded.prescription_gy.ok_or_else(|| {
            format!(
                "{} names no prescription_gy; give --prescription-gy",
                self.source.display()
            )
        })?;
        within("--prescription-gy", gy, 1e-3, 1e4)?;
        Ok(gy)
    }

    fn judge(&self, file: &Path, loaded: &Loaded, most_points: usize) -> Result<Judge, CommandError> {
        let extra = self
            .metrics
            .iter()
            .map(|m| Metric::parse(m))
            .collect::<Result<Vec<_>, _>>()?;
        let given = self.label_names()?;
        let prescription_gy = self.prescription_gy(loaded)?;
        let structures = match contours::structures(file, most_points)? {
            Some((_, _)) if !given.is_empty() => {
                return Err(format!("--name: {} names its structures itself", file.display()).into());
            }
            Some((structures, notes)) => {
                seeds::report(file, &notes);
                structures
            }
            None => self.labelled(file, given, most_points)?,
        };
        let target = self.target.as_deref();
        Ok(Judge::new(
            structures,
            target,
            &extra,
            prescription_gy,
            &loaded.seeds,
            most_points,
        )?)
    }

    fn labelled(
        &self,
        file: &Path,
        given: BTreeMap<u8, String>,
        most_points: usize,
    ) -> Result<Vec<Structure>, CommandError> {
        let voxels = stylet_files::read_voxels(file, &stylet_files::Progress::default())?;
        if let Some((label, name)) = given.iter().find(|(label, _)| !voxels.labels.contains(label)) {
            return Err(format!(
                "--name {label}={name}: {} has no voxel with label {label}",
                file.display()
            )
            .into());
        }
        if let Some(warning) = &voxels.frame.warning {
            seeds::report(file, std::slice::from_ref(warning));
        }
        // The names in the file count where none are given.
        let mut names = voxels.names.clone();
        names.extend(given);
        Ok(labels::structures(&voxels, &names, most_points))
    }

    fn label_names(&self) -> Result<BTreeMap<u8, String>, CommandError> {
        let mut names = BTreeMap::new();
        for text in &self.names {
            let wrong = || format!("--name {text}: write LABEL=NAME with a label from 1 to 255, as in 1=Prostate");
            let (label, name) = text.split_once('=').ok_or_else(wrong)?;
            let label: u8 = label.trim().parse().ok().filter(|&l| l > 0).ok_or_else(wrong)?;
            let name = name.trim();
            if name.is_empty() || names.values().any(|n| n == name) {
                return Err(format!("--name {text}: the name is empty or there twice").into());
            }
            if names.insert(label, name.to_owned()).is_some() {
                return Err(format!("--name {text}: label {label} has two names").into());
            }
        }
        Ok(names)
    }

    fn provenance(&self, source: &Source, seeds: &[Seed]) -> serde_json::Value {
        json!({
            "source": { "model": source.model, "nuclide": source.nuclide },
            "seeds": seeds.len(),
            "seeds_2d": seeds.iter().filter(|s| s.axis.is_some()).count(),
            "total_strength_u": seeds.iter().map(|s| s.strength_u).sum::<f64>(),
            "from_days": self.from_days,
            "to_days": self.to_days,
            "implant_date": self.implant_date.map(|day| day.to_string()),
            "version": env!("CARGO_PKG_VERSION"),
        })
    }
}

fn grid(seeds: &[Seed], kernel: &DoseKernel, spacing_m: f64) -> Result<DoseGrid, CommandError> {
    let places: Vec<[f64; 3]> = seeds.iter().map(|s| s.position_m).collect();
    let (low, high) = structure::bounds(&places);
    let (low, high) = (low.map(|v| v - GRID_MARGIN_M), high.map(|v| v + GRID_MARGIN_M));
    let mut grid = DoseGrid::covering(low, high, spacing_m)?;
    grid.add(kernel, seeds);
    Ok(grid)
}

fn within(option: &str, value: f64, least: f64, most: f64) -> Result<(), CommandError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(format!("{option} {value}: give {least} to {most}").into())
}
