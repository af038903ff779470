//! Common parts of `dose`, `perturb` and `dicom`: source, seeds, times and structures.

use crate::CommandError;
use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stylet_base::nuclide::Nuclide;
use stylet_dose::decay::{Interval, days_to_s, left_after};
use stylet_dose::edema::Edema;
use stylet_dose::kernel::DoseKernel;
use stylet_dose::metric::Metric;
use stylet_dose::perturb::Errors;
use stylet_dose::report::{Judge, choose_target};
use stylet_dose::seed::Seed;
use stylet_dose::source::Source;
use stylet_dose::structure::Structure;
use stylet_files::dicom::plan::{Date, PlanSeed};
use stylet_implant::plan::seeds;
use stylet_implant::readers::{Declared, Mapped, SeedDefaults, contours, dose_seed, labels, places, read_source};
use stylet_population as population;

/// Options of all commands that compute dose.
#[derive(Args, Debug)]
pub struct Common {
    /// Source file (TOML), or the model of a source that 'host-ui sources' lists
    #[arg(long, value_name = "FILE", required = true)]
    source: Option<PathBuf>,
    /// Strength in U of seeds whose file gives none
    #[arg(long, value_name = "U")]
    strength_u: Option<f64>,
    /// Meaning of a column in the table of seeds: NAME=HEADER with its unit, as in
    /// x_mm=-Lateral:cm; may be given several times
    #[arg(long = "column", value_name = "NAME=HEADER[:UNIT]")]
    columns: Vec<Mapped>,
    /// Days between the measurement of the strengths and the implant, during which the seeds
    /// decayed
    #[arg(long, value_name = "DAYS", default_value_t = 0.0)]
    measured_days_before: f64,
    /// Day of the implant (2026-10-31), to which strengths with a reference date decay, such as
    /// those of an RT Plan
    #[arg(long, value_name = "DATE", conflicts_with = "measured_days_before")]
    pub implant_date: Option<Date>,
    /// Count dose from this day after the implant
    #[arg(long, value_name = "DAYS", default_value_t = 0.0)]
    from_days: f64,
    /// Count dose up to this day after the implant [default: without end]
    #[arg(allow_negative_numbers = true, long, value_name = "DAYS")]
    to_days: Option<f64>,
    /// Prescribed dose in Gy [default: that of the plan, or else of the source file]
    #[arg(long, value_name = "GY")]
    prescription_gy: Option<f64>,
    /// Name of a label: 1=Prostate; may be given several times
    #[arg(long = "name", value_name = "LABEL=NAME")]
    names: Vec<String>,
    /// Structure of the prescription [default: the one named PTV, CTV, prostate, gland, ..., or the
    /// lowest label]
    #[arg(long, value_name = "NAME")]
    pub target: Option<String>,
    /// Additional metric of every structure: D90, D2cc, V150, V145Gy, Dmean, Dmax, Dmin; may be
    /// given several times
    #[arg(long = "metric", value_name = "METRIC")]
    metrics: Vec<String>,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Swelling of the gland.
#[derive(Args, Debug)]
pub struct EdemaArgs {
    /// Swelling of the gland at the implant, in percent of its volume without it
    #[arg(long, value_name = "PERCENT", requires = "edema_half_life")]
    pub edema: Option<f64>,
    /// Time in which half of the swelling is lost
    #[arg(long, value_name = "DAYS", requires = "edema")]
    pub edema_half_life: Option<f64>,
}

/// Input of a dose computation.
pub struct Loaded {
    /// Model of the seeds.
    pub source: Source,
    /// Dose of a seed of 1 U over the requested time.
    pub kernel: DoseKernel,
    /// Seeds, with their strength at the implant.
    pub seeds: Vec<Seed>,
    /// Seeds with needle, hole and the strength of the file.
    pub rows: Vec<PlanSeed>,
    /// Declarations of a plan about its seeds.
    pub declared: Option<Declared>,
    prescription_gy: Option<f64>,
}

impl Common {
    /// Returns the file of the source.
    pub fn source(&self) -> Result<&Path, CommandError> {
        Ok(self
            .source
            .as_deref()
            .ok_or("give the source of the seeds with --source FILE")?)
    }

    /// Loads source, dose of a seed of 1 U over the requested time, and seeds with their strength
    /// at the implant.
    pub fn load(&self, path: &Path) -> Result<Loaded, CommandError> {
        within("--measured-days-before", self.measured_days_before, 0.0, 1e6)?;
        within("--from-days", self.from_days, 0.0, 1e6)?;
        if let Some(to) = self.to_days {
            within("--to-days", to, self.from_days, 1e6)?;
        }
        if let Some(u) = self.strength_u {
            within("--strength-u", u, 0.0, 1e5)?;
        }
        let source_file = self.source()?;
        let source = read_source(source_file)?;
        let is_taken_out = Nuclide::parse(&source.nuclide).is_some_and(|n| !n.is_of_permanent_seeds());
        if is_taken_out && self.to_days.is_none() {
            return Err(format!(
                "{} is {}, whose sources are taken out again; give the time that they stay with --to-days",
                source_file.display(),
                source.nuclide
            )
            .into());
        }
        let defaults = SeedDefaults {
            strength_u: self.strength_u,
            strength_per_activity_u_per_mci: source.strength_per_activity_u_per_mci,
            columns: self.columns.clone(),
        };
        let mut file = seeds::read(path, defaults)?;
        let of_file = file.rows.clone();
        let day = self.implant_date;
        let agreed = file.agree(&source, self.prescription_gy, day);
        let (prescription_gy, notes) = agreed.map_err(|why| format!("{}: {why}", path.display()))?;
        seeds::report(path, &notes);
        let declared = file.declared.take();
        let mut all: Vec<Seed> = file.rows.iter().map(dose_seed).collect();
        if source.tables.anisotropy_2d.is_none() && all.iter().any(|s| s.axis.is_some()) {
            return Err(format!(
                "{} has no [anisotropy_2d], which seeds with an axis need; leave the axis columns out",
                source_file.display()
            )
            .into());
        }
        if source.tables.anisotropy_1d.is_none() && all.iter().any(|s| s.axis.is_none()) {
            return Err(format!(
                "{} has no [anisotropy_1d], which seeds without an axis need; give every seed its axis",
                source_file.display()
            )
            .into());
        }
        let left = left_after(days_to_s(self.measured_days_before), source.half_life_s);
        for seed in &mut all {
            seed.strength_u *= left;
        }
        let mut rows = of_file;
        // A strength without a day is that of the implant.
        for (row, seed) in rows.iter_mut().zip(&all).filter(|(row, _)| row.strength_on.is_none()) {
            row.strength_u = seed.strength_u;
        }
        seeds::report(path, places::on_one_spot(&all).as_slice());
        let interval = Interval::days(self.from_days, self.to_days.unwrap_or(f64::INFINITY));
        let kernel = DoseKernel::new(&source, interval);
        Ok(Loaded {
            source,
            kernel,
            seeds: all,
            rows,
            declared,
            prescription_gy,
        })
    }

    /// Returns the prescription: of the option, the plan or the source.
    pub fn prescription_gy<'a>(&self, loaded: impl Into<Option<&'a Loaded>>) -> Result<f64, CommandError> {
        let gy = match (loaded.into(), &self.source) {
            (Some(loaded), Some(source)) => loaded.prescription_gy.ok_or_else(|| {
                let file = source.display();
                format!("{file} names no prescription_gy; give --prescription-gy")
            })?,
            _ => self
                .prescription_gy
                .ok_or("give the prescribed dose with --prescription-gy")?,
        };
        within("--prescription-gy", gy, 1e-3, 1e4)?;
        Ok(gy)
    }

    pub fn judge(&self, file: &Path, loaded: &Loaded, most_points: usize) -> Result<Judge, CommandError> {
        let (structures, _) = self.structures(file, &loaded.seeds, most_points)?;
        self.judge_of(structures, loaded, &[], most_points)
    }

    /// Prepares structures for evaluation with the requested metrics and `more`.
    pub fn judge_of(
        &self,
        structures: Vec<Structure>,
        loaded: &Loaded,
        more: &[Metric],
        most_points: usize,
    ) -> Result<Judge, CommandError> {
        let mut metrics = self.extra_metrics()?;
        for metric in more {
            if !metrics.contains(metric) {
                metrics.push(*metric);
            }
        }
        Ok(Judge::new(
            structures,
            self.target.as_deref(),
            &metrics,
            self.prescription_gy(loaded)?,
            &loaded.seeds,
            most_points,
        )?)
    }

    /// Returns the requested metrics.
    pub fn extra_metrics(&self) -> Result<Vec<Metric>, CommandError> {
        let metrics = self.metrics.iter().map(|m| Metric::parse(m));
        Ok(metrics.collect::<Result<Vec<_>, _>>()?)
    }

    /// Returns whether the dose covers the whole life of the seeds.
    pub fn is_for_ever(&self) -> bool {
        self.from_days == 0.0 && self.to_days.is_none()
    }

    /// Returns the swelling that was asked for.
    pub fn edema(&self, asked: &EdemaArgs) -> Result<Option<Edema>, CommandError> {
        let (Some(percent), Some(days)) = (asked.edema, asked.edema_half_life) else {
            return Ok(None);
        };
        within("--edema", percent, 0.0, 300.0)?;
        within("--edema-half-life", days, 0.1, 1000.0)?;
        if !self.is_for_ever() {
            return Err(
                "--edema is for the dose of the whole life of the seeds; leave --from-days and --to-days out".into(),
            );
        }
        Ok(Some(Edema::of_days(percent / 100.0, days)))
    }

    /// Returns the reference day of the strengths, in words.
    pub fn calibrated(&self, loaded: &Loaded) -> String {
        let mut days: Vec<Date> = loaded.rows.iter().filter_map(|row| row.strength_on).collect();
        days.sort_unstable();
        let of_file = match (days.first(), days.last()) {
            (Some(first), Some(last)) if first == last => Some(first.to_string()),
            (Some(first), Some(last)) => Some(format!("{first} to {last}")),
            _ => None,
        };
        match (of_file, self.implant_date) {
            (Some(day), Some(implant)) => format!("calibrated {day}, decayed to the implant on {implant}"),
            (Some(day), None) => format!("calibrated {day}, not decayed"),
            (None, Some(implant)) => format!("as of the implant on {implant}; the file gives no day of calibration"),
            (None, None) if self.measured_days_before > 0.0 => {
                format!(
                    "measured {} days before the implant, decayed since",
                    self.measured_days_before
                )
            }
            (None, None) => "as of the implant; no day of calibration is given".to_owned(),
        }
    }

    /// Returns the structures of a file and the index of the target; reports seeds outside of it.
    pub fn structures(
        &self,
        file: &Path,
        seeds: &[Seed],
        most_points: usize,
    ) -> Result<(Vec<Structure>, usize), CommandError> {
        let given = self.label_names()?;
        // Check the options before reading a long file.
        self.extra_metrics()?;
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
        let names: Vec<&str> = structures.iter().map(|s| s.name.as_str()).collect();
        let at = choose_target(&names, self.target.as_deref())?;
        seeds::report(file, places::outside(seeds, &structures[at]).as_slice());
        Ok((structures, at))
    }

    fn labelled(
        &self,
        file: &Path,
        given: BTreeMap<u8, String>,
        most_points: usize,
    ) -> Result<Vec<Structure>, CommandError> {
        let voxels = stylet_files::watched(file, |progress| stylet_files::read_voxels(file, progress))?;
        if let Some((label, name)) = given.iter().find(|(label, _)| !voxels.present().contains(label)) {
            return Err(format!(
                "--name {label}={name}: {} has no voxel with label {label}",
                file.display()
            )
            .into());
        }
        if let Some(warning) = &voxels.frame.warning {
            seeds::report(file, std::slice::from_ref(warning));
        }
        // Names in the file count if none are given.
        let mut names = voxels.names.clone();
        names.extend(given);
        Ok(labels::structures(&voxels, &names, most_points))
    }

    pub fn label_names(&self) -> Result<BTreeMap<u8, String>, CommandError> {
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

    pub fn provenance(&self, source: &Source, seeds: &[Seed]) -> serde_json::Value {
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

/// Returns and prints the placement errors of a study of rt-core, in the patient's frame.
pub fn errors_of(folder: &Path) -> Result<Errors, CommandError> {
    let read = population::load(folder)?;
    let errors = population::misplacement(&read.table)
        .ok_or_else(|| format!("{}: no seed of it came to rest", folder.display()))?;
    let [x, y, z] = errors.shift_m.map(|m| m * 1e3);
    println!(
        "errors of {}: shift {x:.2}, {y:.2}, {z:.2} mm; deviation {:.2} mm across and {:.2} mm along the needle; correlation on a needle {:.2}",
        folder.display(),
        errors.sigma_m * 1e3,
        errors.along_m.unwrap_or(0.0) * 1e3,
        errors.within_strand
    );
    Ok(errors)
}

pub fn within(option: &str, value: f64, least: f64, most: f64) -> Result<(), CommandError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(format!("{option} {value}: give {least} to {most}").into())
}
