//! The command `host-ui perturb`.

use super::CommandError;
use super::dose::common::{Common, EdemaArgs, Loaded, errors_of, within};
use super::dose::write;
use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stylet_base::interrupt::Interrupt;
use stylet_base::output::new_folder;
use stylet_base::progress_bar::LongTask;
use stylet_dose::criterion::{Criterion, CriterionCount};
use stylet_dose::edema::Swelling;
use stylet_dose::perturb::{self, Errors};
use stylet_dose::report::Judge;
use stylet_files::dicom::Shared;
use stylet_files::together;
use stylet_implant::provenance;

const POINTS_FOR_A_TRIAL: usize = 40_000;
const MAX_TRIALS: u64 = 1_000_000;

const HELP: &str = "\
Every trial moves each seed by a normal error, keeps its axis and strength, and computes all metrics again. The same --seed gives the
same trials on any number of cores. Ctrl-C ends early and writes the trials done so far. Possible errors of the seeds:
  an error of each seed (--sigma-mm); along the needle, the axis of the seed, it may have another deviation (--sigma-along-mm)
  errors common to the seeds of one needle (--strand-correlation): 0 for none, 1 for seeds that move as one
  an error of the whole implant: the same in every trial (--shift-mm), or drawn for each (--shift-sigma-mm)
  loss of single seeds (--loss)
  a gland that swells at the implant and shrinks, with its seeds (--edema, --edema-half-life); the plan applies to the gland without
  edema, and a trial takes about twelve times as long
  instead of those of each seed, the errors that a study of rt-core found: shift, deviations, correlation on a needle (--errors-of)
The random numbers of one error do not change when another is added. The planned figures are those without any error.

Criteria are the limits of ABS and AAPM TG-137 for target (D90, V100, V150), urethra (D10, D30) and rectum (D2cc), and
those of --criterion. The share of trials that meet each has its 95 % interval by Wilson, the mean of each measure by Student's t.

Examples (the first has the settings of published studies, 4 mm and 1000 trials):
  host-ui perturb --source sources/i125_6711.toml --plan seeds.csv --strength-u 0.5 --structures gland.nii.gz \\
      --name 1=Prostate --name 2=Urethra --name 3=Rectum --sigma-mm 4 --trials 1000 --out perturb
  host-ui perturb --source sources/i125_6711.toml --plan plan.toml --structures gland.nii.gz --name 1=Prostate --sigma-mm 2 \\
      --sigma-along-mm 4 --strand-correlation 0.8 --shift-mm 0,0,-2 --loss 0.01 --criterion 'D90>=130.5' --out stranded

Written to --out, a new or empty folder: trials.csv (one line a trial), distribution.csv and distribution.json (planned, mean with its
interval, sd, p5 to p95), criteria.csv (share of trials that meet each), made.json (inputs with their SHA-256, version, time).";

/// Options of `host-ui perturb`.
#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct PerturbArgs {
    #[command(flatten)]
    common: Common,
    /// Planned seeds: CSV, a plan of host-ui (.toml), or a DICOM RT Plan; see `host-ui dose --help`
    #[arg(long, value_name = "FILE")]
    plan: PathBuf,
    /// Structures: NIfTI-1, NRRD, MetaImage, DICOM RT Structure Set or Segmentation
    #[arg(long, value_name = "FILE")]
    structures: PathBuf,
    /// Standard deviation of a seed's error along each axis
    #[arg(long, value_name = "MM", default_value_t = 4.0)]
    sigma_mm: f64,
    /// Standard deviation of its error along the needle; --sigma-mm then applies across it
    #[arg(long, value_name = "MM")]
    sigma_along_mm: Option<f64>,
    /// Correlation of the errors of two seeds of one needle, 0 to 1
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    strand_correlation: f64,
    /// Shift of all seeds in every trial
    #[arg(long, value_name = "X,Y,Z", value_parser = Shift::parse, allow_hyphen_values = true)]
    shift_mm: Option<Shift>,
    /// Standard deviation, along each axis, of a shift common to all seeds of a trial
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    shift_sigma_mm: f64,
    /// Take shift, deviations and correlation from the seeds of a study of rt-core instead: its
    /// folder
    #[arg(long, value_name = "DIR", conflicts_with_all = ["sigma_mm", "sigma_along_mm", "strand_correlation", "shift_mm"])]
    errors_of: Option<PathBuf>,
    /// Probability that a seed is lost, 0 to 1
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    loss: f64,
    #[command(flatten)]
    swelling: EdemaArgs,
    /// Additional criterion: "D90>=130.5" of the target (Gy), "Urethra V150<=10" (percent); may be
    /// given several times
    #[arg(long = "criterion", value_name = "CRITERION")]
    criteria: Vec<String>,
    /// Number of trials, each with its own random errors
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=MAX_TRIALS))]
    trials: u64,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Three lengths in mm, as typed.
#[derive(Clone, Copy, Debug)]
struct Shift([f64; 3]);

/// Text that is not three lengths.
#[derive(Debug, thiserror::Error)]
#[error("expected three numbers in mm such as 0,0,-2")]
struct NotThree;

impl Shift {
    fn parse(text: &str) -> Result<Self, NotThree> {
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
        let three = <[f64; 3]>::try_from(numbers.map_err(|_| NotThree)?).map_err(|_| NotThree)?;
        Ok(Self(three))
    }
}

impl PerturbArgs {
    pub fn run(self) -> Result<(), CommandError> {
        let c = &self.common;
        let errors = self.errors()?;
        let edema = c.edema(&self.swelling)?;
        together(&[Some(&self.plan), Some(&self.structures)], Shared::Frame)?;
        let loaded = c.load(&self.plan)?;
        let kernel = &loaded.kernel;
        let strands = self.strands(&loaded, &errors)?;
        let (judge, criteria) = self.judge(&loaded)?;
        let how = perturb::Perturbation {
            errors,
            trials: self.trials as usize,
            random_seed: self.seed,
        };
        let plan = perturb::Planned {
            seeds: &loaded.seeds,
            strands: &strands,
            swelling: edema.map(|edema| Swelling {
                edema,
                half_life_s: loaded.source.half_life_s,
            }),
        };
        let stop = Interrupt::on_signals()?;
        new_folder(&c.out)?;
        let planned = judge.values(&judge.judge(kernel, plan.seeds));
        let task = LongTask::new(self.trials, "trials");
        let trials = perturb::trials(&judge, kernel, plan, how, || stop.asked(), || task.advance(1));
        drop(task);
        if trials.is_empty() {
            return Err("stopped before the first trial was done; nothing is written".into());
        }
        let spreads = perturb::spreads(&planned, &trials);
        let kept: Vec<CriterionCount> = criteria.iter().filter_map(|c| c.kept(&planned, &trials)).collect();
        write::trials(&c.out.join("trials.csv"), &planned, &trials)?;
        write::distribution(&c.out.join("distribution.csv"), &spreads)?;
        write::criteria(&c.out.join("criteria.csv"), &kept)?;
        let mut result = write::spreads_json(&spreads);
        result["criteria"] = write::criteria_json(&kept);
        result["dose"] = c.provenance(&loaded.source, plan.seeds);
        result["sigma_mm"] = json!(self.sigma_mm);
        result["sigma_along_mm"] = json!(self.sigma_along_mm);
        result["strand_correlation"] = json!(self.strand_correlation);
        result["shift_mm"] = json!(self.shift_mm.map(|shift| shift.0));
        result["shift_sigma_mm"] = json!(self.shift_sigma_mm);
        result["loss"] = json!(self.loss);
        result["edema_percent"] = json!(self.swelling.edema);
        result["edema_half_life_days"] = json!(self.swelling.edema_half_life);
        result["random_seed"] = json!(self.seed);
        result["trials"] = json!(trials.len());
        result["trials_asked"] = json!(self.trials);
        let mut inputs: Vec<(&str, &Path)> = vec![
            ("--source", c.source()?),
            ("--plan", &self.plan),
            ("--structures", &self.structures),
        ];
        inputs.extend(self.errors_of.as_deref().map(|folder| ("--errors-of", folder)));
        result["made"] = provenance::made(&inputs)?;
        write::json(&c.out.join("made.json"), &result["made"])?;
        write::json(&c.out.join("distribution.json"), &result)?;
        print!(
            "{}{}",
            stylet_base::format::printable_table(&write::spread_table(&spreads)),
            stylet_base::format::printable_table(&write::criteria_table(&kept))
        );
        if trials.len() < how.trials {
            println!("stopped after {} of {} trials", trials.len(), how.trials);
        }
        println!("written: {}", c.out.display());
        Ok(())
    }

    fn errors(&self) -> Result<Errors, CommandError> {
        within("--sigma-mm", self.sigma_mm, 0.0, 100.0)?;
        within("--sigma-along-mm", self.sigma_along_mm.unwrap_or(0.0), 0.0, 100.0)?;
        within("--strand-correlation", self.strand_correlation, 0.0, 1.0)?;
        within("--shift-sigma-mm", self.shift_sigma_mm, 0.0, 100.0)?;
        within("--loss", self.loss, 0.0, 1.0)?;
        let shift_mm = self.shift_mm.map_or([0.0; 3], |shift| shift.0);
        for mm in shift_mm {
            within("--shift-mm", mm, -100.0, 100.0)?;
        }
        let own = match &self.errors_of {
            Some(folder) => errors_of(folder)?,
            None => Errors {
                sigma_m: self.sigma_mm * 1e-3,
                along_m: self.sigma_along_mm.map(|mm| mm * 1e-3),
                within_strand: self.strand_correlation,
                shift_m: shift_mm.map(|mm| mm * 1e-3),
                ..Errors::of_sigma(0.0)
            },
        };
        Ok(Errors {
            shift_sigma_m: self.shift_sigma_mm * 1e-3,
            loss: self.loss,
            ..own
        })
    }

    /// Returns the needle of each seed, counted from 0, if the errors depend on it; refuses a file
    /// without the data they need.
    fn strands(&self, loaded: &Loaded, errors: &Errors) -> Result<Vec<usize>, CommandError> {
        let (file, all) = (self.plan.display(), loaded.rows.len());
        let without_axis = loaded.seeds.iter().filter(|s| s.axis.is_none()).count();
        if errors.along_m.is_some() && without_axis > 0 {
            return Err(format!(
                "errors along the needle: {without_axis} of {all} seeds of {file} have no axis; give the columns axis_x, axis_y, axis_z"
            )
            .into());
        }
        if errors.within_strand == 0.0 {
            return Ok(Vec::new());
        }
        let without_needle = loaded.rows.iter().filter(|row| row.needle.is_none()).count();
        if without_needle > 0 {
            return Err(format!(
                "correlated errors: {without_needle} of {all} seeds of {file} have no needle; give the column needle"
            )
            .into());
        }
        let mut numbers = BTreeMap::new();
        let needles = loaded.rows.iter().filter_map(|row| row.needle);
        let strand = |needle: u32| {
            let next = numbers.len();
            *numbers.entry(needle).or_insert(next)
        };
        Ok(needles.map(strand).collect())
    }

    fn judge(&self, loaded: &Loaded) -> Result<(Judge, Vec<Criterion>), CommandError> {
        let c = &self.common;
        let (structures, target) = c.structures(&self.structures, &loaded.seeds, POINTS_FOR_A_TRIAL)?;
        let names: Vec<&str> = structures.iter().map(|s| s.name.as_str()).collect();
        let asked = self.criteria.iter().map(|text| Criterion::parse(text, &names, target));
        let (asked, metrics): (Vec<_>, Vec<_>) = asked.collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
        let judge = c.judge_of(structures, loaded, &metrics, POINTS_FOR_A_TRIAL)?;
        let mut criteria = judge.criteria();
        criteria.extend(asked);
        Ok((judge, criteria))
    }
}
