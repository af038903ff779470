//! The command `host-ui plan`: a plan file for the scene of a running core.

use super::CommandError;
use super::dose::common::{errors_of, within};
use clap::Args;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use stylet_anatomy::PatientFrame;
use stylet_base::progress_bar::progress_bar;
use stylet_base::write_whole;
use stylet_dose::decay::Interval;
use stylet_dose::perturb::Errors;
use stylet_dose::report::Judge;
use stylet_dose::{DoseKernel, Source};
use stylet_files::dicom::plan::Date;
use stylet_files::dicom::{Identity, Shared};
use stylet_files::together;
use stylet_host::core_args::CoreArgs;
use stylet_implant::plan::exchange::beside_scene;
use stylet_implant::plan::first::{self, FirstPlan};
use stylet_implant::plan::optimise::{Objectives, Statistic};
use stylet_implant::plan::{Anatomy, ImplantPlan, Template, check};
use stylet_implant::plan::{file, seeds};
use stylet_implant::procedure::Live;
use stylet_implant::provenance;
use stylet_implant::readers::{Mapped, SeedDefaults, SeedFile, read_source};
use stylet_population as population;

const POINTS: usize = 100_000;

const HELP: &str = "\
Without --seeds the command searches needles, seeds and one strength that meet the limits: target V100 at least 95 %, D90 100 to 125 %,
V150 at most 60 %; urethra D10 at most 150 %, D30 130 %; rectum D2cc at most 100 %; at most 25 needles, none through bone. A limit
that cannot be met is reported. Within the limits the plan is robust: 95 % of 300 trials in which every seed is misplaced by 4 mm
along each axis (standard deviation) meet a D90 of 90 % of the prescription. --robust selects their mean or another percentile,
--misplacement-mm another deviation, and --errors-of takes shift, deviations and correlation from the seeds of a study. --compare
searches three plans, prints the robustness and the cost of each, and writes one of them. A note says if no urethra is known. With --seeds the plan consists of the seeds of a table (columns as in 'host-ui dose --help'), assigned
to needles by their numbers, or by their lines if there are none.

Units: mm, patient frame (RAS); strength in U (1 U = 1 cGy cm2/h).

Examples:
  host-ui plan --core target/quick/rt-core --source sources/i125_6711.toml --out plan.toml --csv seeds.csv
  host-ui plan --source sources/i125_6711.toml --robust p10 --errors-of out/paper --needles 20 --out plan.toml
  host-ui plan --source sources/i125_6711.toml --compare fewer-needles --out plan.toml
  host-ui plan --source sources/i125_6711.toml --seeds seeds.csv --strength-u 0.5 --out plan.toml
  host-ui procedure --plan plan.toml --compensate --insert-speed 120 --out out/implant";

#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct PlanArgs {
    #[command(flatten)]
    asked: CoreArgs,
    /// Start this rt-core when none is running, and end it afterwards
    #[arg(long, value_name = "PATH")]
    core: Option<PathBuf>,
    /// Source file (TOML), or the model of a source that 'host-ui sources' lists
    #[arg(long, value_name = "FILE")]
    source: PathBuf,
    /// Prescribed dose in Gy [default: that of the seeds' plan, or else of the source file]
    #[arg(long, value_name = "GY")]
    prescription_gy: Option<f64>,
    /// Seeds to use instead (CSV, a plan .toml, or a DICOM RT Plan)
    #[arg(long, value_name = "FILE")]
    seeds: Option<PathBuf>,
    /// Strength in U of seeds whose table gives none
    #[arg(long, value_name = "U", requires = "seeds")]
    strength_u: Option<f64>,
    /// Meaning of a column in the table of seeds: NAME=HEADER with its unit, as in
    /// x_mm=-Lateral:cm; may be given several times
    #[arg(long = "column", value_name = "NAME=HEADER[:UNIT]", requires = "seeds")]
    columns: Vec<Mapped>,
    /// Day of the implant (2026-10-31), to which strengths with a reference date decay
    #[arg(long, value_name = "DATE", requires = "seeds")]
    implant_date: Option<Date>,
    /// D90 that must be at least 90 % of the prescription when seeds are misplaced
    #[arg(long, value_enum, default_value_t = Robust::P5, conflicts_with = "seeds")]
    robust: Robust,
    /// Standard deviation of a seed's error along each axis, for --robust
    #[arg(long, value_name = "MM", default_value_t = 4.0, conflicts_with = "seeds")]
    misplacement_mm: f64,
    /// Take the errors of seeds from a study of rt-core instead: its folder
    #[arg(long, value_name = "DIR", conflicts_with_all = ["seeds", "misplacement_mm"])]
    errors_of: Option<PathBuf>,
    /// Maximum number of needles
    #[arg(long, value_name = "N", default_value_t = 25, conflicts_with = "seeds", value_parser = clap::value_parser!(u8).range(1..=60))]
    needles: u8,
    /// Search for three plans, robust, with fewer needles and with lower V150, compare them, and
    /// write this one
    #[arg(long, value_enum, conflicts_with = "seeds")]
    compare: Option<Wanted>,
    /// Plan file to write (TOML)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Table of the seeds to write in addition
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

/// Aim of a search, as a D90.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Robust {
    /// The D90 of the plan alone
    Planned,
    /// The mean D90 of 300 trials
    Expected,
    /// The D90 that 90 % of the trials reach
    P10,
    /// The D90 that 95 % of the trials reach
    P5,
}

impl Robust {
    fn statistic(self) -> Statistic {
        match self {
            Self::Planned => Statistic::Planned,
            Self::Expected => Statistic::Expected,
            Self::P10 => Statistic::KeptBy(0.9),
            Self::P5 => Statistic::USUAL,
        }
    }
}

/// Choice among several plans.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Wanted {
    /// The most robust one
    Robust,
    /// The one with the fewest needles
    FewerNeedles,
    /// The one with the smallest V150
    LowerV150,
}

impl PlanArgs {
    pub fn run(self) -> Result<(), CommandError> {
        let source = read_source(&self.source)?;
        let identity = match &self.seeds {
            Some(seeds) => beside_scene(self.asked.file(), seeds)?.reported(),
            None => together(&[self.asked.file()], Shared::Frame)?,
        };
        let (seeds, prescription_gy) = self.seeds(&source)?;
        let prescription_gy = prescription_gy.filter(|gy| (1e-3..=1e4).contains(gy)).ok_or_else(|| {
            let file = self.source.display();
            format!(
                "{file} names no prescription_gy, or --prescription-gy is not 0.001 to 10000; give --prescription-gy"
            )
        })?;
        let live = Live::connect(&self.asked, self.core.as_deref())?;
        let (anatomy, template) = (Anatomy::of(&live.scene)?, Template::before(&live.scene.header));
        let frames = anatomy.patient;
        let kernel = DoseKernel::new(&source, Interval::ALL);
        let plan = match seeds {
            None => {
                let bar = progress_bar(100, "% of the search");
                let report = |share: f32| {
                    bar.set_position((share * 100.0) as u64);
                    ControlFlow::Continue(())
                };
                let objectives = self.objectives(&source, prescription_gy, &frames)?;
                let count = if self.compare.is_some() { 3 } else { 1 };
                let found = first::proposals(template, &anatomy, &kernel, &source, &objectives, count, report);
                bar.finish_and_clear();
                let mut found = found?;
                print!("{}", comparison(&found));
                let wanted = self.compare.map_or(0, |wanted| wanted as usize);
                let found = found.swap_remove(wanted.min(found.len() - 1));
                for note in &found.notes {
                    println!("note: {}", stylet_base::format::printable_line(note));
                }
                found.found.plan
            }
            Some((path, seeds)) => file::import(path, seeds, &frames, template, &source.model, prescription_gy)?,
        };
        for problem in check::problems(&plan, &anatomy) {
            println!("note: {}", stylet_base::format::printable_line(&problem.to_string()));
        }
        self.write(&plan, &frames, identity.as_ref())?;
        let (figures, broken) = figures(&plan, &anatomy, &kernel)?;
        for criterion in &broken {
            println!("note: {}", stylet_base::format::printable_line(criterion));
        }
        print!("{}", stylet_base::format::printable_table(&figures));
        println!("written: {}", self.out.display());
        Ok(())
    }

    /// Returns the objectives of the search.
    fn objectives(
        &self,
        source: &Source,
        prescription_gy: f64,
        frames: &PatientFrame,
    ) -> Result<Objectives, CommandError> {
        within("--misplacement-mm", self.misplacement_mm, 0.1, 20.0)?;
        let mut objectives = Objectives::new(source, prescription_gy);
        objectives.robust = self.robust.statistic();
        objectives.needles = usize::from(self.needles);
        objectives.misplacement.errors = match &self.errors_of {
            None => Errors::of_sigma(self.misplacement_mm * 1e-3),
            Some(folder) => population::turned(errors_of(folder)?, &frames.rotation().transpose()),
        };
        Ok(objectives)
    }

    /// Returns the seeds of the file, compared with the source, and the prescription.
    fn seeds(&self, source: &Source) -> Result<SeedsAndPrescription<'_>, CommandError> {
        let Some(path) = self.seeds.as_deref() else {
            return Ok((None, self.prescription_gy.or(source.prescription_gy)));
        };
        let defaults = SeedDefaults {
            strength_u: self.strength_u,
            strength_per_activity_u_per_mci: source.strength_per_activity_u_per_mci,
            columns: self.columns.clone(),
        };
        let mut seeds = seeds::read(path, defaults)?;
        let agreed = seeds.agree(source, self.prescription_gy, self.implant_date);
        let (prescription_gy, notes) = agreed.map_err(|why| format!("{}: {why}", path.display()))?;
        seeds::report(path, &notes);
        Ok((Some((path, seeds)), prescription_gy))
    }

    fn write(
        &self,
        plan: &ImplantPlan,
        frames: &PatientFrame,
        identity: Option<&Identity>,
    ) -> Result<(), CommandError> {
        let mut inputs: Vec<(&str, &Path)> = vec![("--source", &self.source)];
        inputs.extend(self.seeds.as_deref().map(|file| ("--seeds", file)));
        inputs.extend(self.asked.file().map(|file| ("--scene", file)));
        inputs.extend(self.errors_of.as_deref().map(|folder| ("--errors-of", folder)));
        let made = serde_json::to_string(&provenance::made(&inputs)?)?;
        // One line, because JSON has no line feeds of its own.
        let comments = format!(
            "{}# made: {made}\n",
            identity.map(Identity::comments).unwrap_or_default()
        );
        let text = comments.clone() + &file::to_text(plan, frames)?;
        write_whole(&self.out, text.as_bytes())?;
        let Some(csv) = &self.csv else { return Ok(()) };
        let text = comments + &file::seeds_to_csv(plan, frames);
        Ok(write_whole(csv, text.as_bytes())?)
    }
}

/// Returns the proposals, one a line.
fn comparison(found: &[FirstPlan]) -> String {
    let mut text = format!(
        "{:14} {:>6} {:>6} {:>6} {:>7} {:>5} {:>8} {:>10} {:>8} {:>7}\n",
        "plan", "V100", "D90", "V150", "needles", "seeds", "meet D90", "mean D90", "D90 p10", "limits"
    );
    for plan in found {
        let m = &plan.found;
        text += &format!(
            "{:14} {:6.1} {:6.1} {:6.1} {:7} {:5} {:8.1} {:10.1} {:8.1} {:>7}\n",
            plan.name,
            m.figures.v100,
            m.figures.d90,
            m.figures.v150,
            m.plan.needles.len(),
            m.plan.seed_count(),
            m.robust * 100.0,
            m.expected_d90,
            m.d90_p10,
            if m.figures.beyond() == 0.0 { "kept" } else { "broken" }
        );
    }
    text
}

/// File with its seeds, if one was given, and the dose in gray.
type SeedsAndPrescription<'a> = (Option<(&'a Path, SeedFile)>, Option<f64>);

/// Returns the measures as a table, and the limits that they violate.
fn figures(plan: &ImplantPlan, anatomy: &Anatomy, kernel: &DoseKernel) -> Result<(String, Vec<String>), CommandError> {
    let seeds = plan.seeds();
    let strengths = seeds.iter().map(|s| s.strength_u);
    let total: f64 = strengths.clone().sum();
    let structures = anatomy.structures();
    let judge = Judge::new(
        structures,
        Some(&anatomy.target.name),
        &[],
        plan.prescription_gy,
        &seeds,
        POINTS,
    )?;
    let verdict = judge.judge(kernel, &seeds);
    let broken = judge.figures(&verdict).iter().filter_map(|f| f.broken()).collect();
    let text = format!(
        "{} needles, {} seeds, {total:.2} U in all ({:.3} to {:.3} U a seed)\n{}",
        plan.needles.len(),
        seeds.len(),
        strengths.clone().fold(f64::INFINITY, f64::min),
        strengths.fold(0.0, f64::max),
        judge.table(&verdict)
    );
    Ok((text, broken))
}
