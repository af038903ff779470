//! The command `host-ui compare`: differences between two doses.

use super::CommandError;
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};
use stylet_dose::gamma::{self, Agreement, Criterion};
use stylet_files::FileError;
use stylet_files::dicom::Shared;
use stylet_files::dicom::dose::ReadDose;
use stylet_files::together;
use stylet_implant::plan::seeds;
use stylet_implant::provenance;
use stylet_implant::readers::{at_gy, places_m, read_any_dose};

/// Share of the highest dose below which doses are left out of relative differences.
const USUAL_THRESHOLD_PERCENT: f64 = 10.0;

const HELP: &str = "\
Doses are RT Dose (.dcm), dose_grid.csv of host-ui dose, or NRRD, NIfTI-1 or MetaImage in Gy, of one patient, frame of
reference and type. The second one is interpolated linearly at every voxel of the first; voxels outside of it are counted
and left out.

With --gamma the share of voxels whose gamma index is at most 1 is reported too (Low et al. 1998). It takes a dose difference in
percent and a distance in mm, and searches in three dimensions, between voxels, up to a gamma of 2. The percents refer to --of-gy
(global), or with --local to the dose at each voxel.

Examples:
  host-ui compare study/dose.dcm other/dose.dcm --json difference.json
  host-ui compare study/dose.dcm other/dose.dcm --of-gy 145 --gamma 3,2";

/// Options of `host-ui compare`.
#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct CompareArgs {
    /// Dose to compare
    dose: PathBuf,
    /// Dose to compare it with
    with: PathBuf,
    /// Count only voxels where the first dose is at least this share of --of-gy
    #[arg(long, value_name = "PERCENT", default_value_t = USUAL_THRESHOLD_PERCENT)]
    threshold: f64,
    /// Dose to which the shares refer, such as the prescription [default: the highest of the first
    /// dose]
    #[arg(long, value_name = "GY")]
    of_gy: Option<f64>,
    /// Compute the gamma index too: allowed dose difference and distance, such as 3,2
    #[arg(long, value_name = "PERCENT,MM", value_delimiter = ',')]
    gamma: Option<Vec<f64>>,
    /// Take the percents of the gamma index from the dose at each voxel
    #[arg(long, requires = "gamma")]
    local: bool,
    /// File for the figures
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Differences, second dose minus first, in Gy.
struct Difference {
    compared: usize,
    outside: usize,
    mean_gy: f64,
    root_mean_square_gy: f64,
    largest_gy: f64,
    largest_at_mm: [f64; 3],
}

impl CompareArgs {
    /// Executes the command.
    pub fn run(self) -> Result<(), CommandError> {
        if !(0.0..=1000.0).contains(&self.threshold) {
            return Err(format!("--threshold {}: give 0 to 1000 percent", self.threshold).into());
        }
        together(&[Some(&self.dose), Some(&self.with)], Shared::Frame)?;
        let (one, other) = (read_any_dose(&self.dose)?, read_any_dose(&self.with)?);
        for (path, dose) in [(&self.dose, &one), (&self.with, &other)] {
            seeds::report(path, &dose.notes);
        }
        one.kind
            .comparable(&other.kind)
            .map_err(|why| FileError::of(&self.with, why))?;
        let highest = one.dose_gy.iter().copied().fold(0.0, f64::max);
        let of_gy = self.of_gy.unwrap_or(highest);
        if !(of_gy > 0.0 && of_gy.is_finite()) {
            return Err("the first dose is 0 everywhere, or --of-gy is not above 0".into());
        }
        let found = difference(&one, &other, self.threshold / 100.0 * of_gy)
            .ok_or("the two doses have no voxel in common; are they of one frame of reference?")?;
        let percent = |gy: f64| gy / of_gy * 100.0;
        println!(
            "{} voxels compared, {} outside of the second dose",
            found.compared, found.outside
        );
        for (name, gy) in [
            ("mean", found.mean_gy),
            ("root mean square", found.root_mean_square_gy),
            ("largest", found.largest_gy),
        ] {
            println!("{name:<17} {gy:>14.6} Gy {:>12.6} % of {of_gy:.3} Gy", percent(gy));
        }
        let [x, y, z] = found.largest_at_mm;
        println!("the largest is at {x:.2}, {y:.2}, {z:.2} mm");
        let gamma = self.criterion(of_gy)?.map(|criterion| {
            let agreement = agreement(&one, &other, self.threshold / 100.0 * of_gy, &criterion);
            (criterion, agreement)
        });
        if let Some((criterion, Some(found))) = &gamma {
            println!(
                "gamma {:.1} % ({}), {:.1} mm: {:.2} % of {} voxels pass, mean {:.3}, highest {}",
                criterion.dose_share * 100.0,
                self.side(),
                criterion.distance_m * 1e3,
                found.passed as f64 / found.compared as f64 * 100.0,
                found.compared,
                found.mean,
                highest_gamma(found.highest),
            );
        }
        if let Some(file) = &self.json {
            let inputs: [(&str, &Path); 2] = [("dose", &self.dose), ("with", &self.with)];
            let mut value = json!({
                "compared": found.compared,
                "outside": found.outside,
                "of_gy": of_gy,
                "threshold_percent": self.threshold,
                "mean_gy": found.mean_gy,
                "root_mean_square_gy": found.root_mean_square_gy,
                "largest_gy": found.largest_gy,
                "largest_at_mm": found.largest_at_mm,
                "made": provenance::made(&inputs)?,
            });
            if let Some((criterion, Some(found))) = &gamma {
                value["gamma"] = json!({
                    "dose_percent": criterion.dose_share * 100.0,
                    "percent_of": self.side(),
                    "distance_mm": criterion.distance_m * 1e3,
                    "compared": found.compared,
                    "passed": found.passed,
                    "mean": found.mean,
                    "highest": found.highest,
                    "searched_to": gamma::HIGHEST,
                });
            }
            super::dose::write::json(file, &value)?;
            println!("written: {}", file.display());
        }
        Ok(())
    }

    fn criterion(&self, of_gy: f64) -> Result<Option<Criterion>, CommandError> {
        let criterion = |percent: f64, mm: f64| Criterion {
            dose_share: percent / 100.0,
            of_gy: (!self.local).then_some(of_gy),
            distance_m: mm * 1e-3,
        };
        match self.gamma.as_deref() {
            None => Ok(None),
            Some([percent, mm]) if (0.01..=100.0).contains(percent) && (0.01..=50.0).contains(mm) => {
                Ok(Some(criterion(*percent, *mm)))
            }
            Some(_) => Err("--gamma: give 0.01 to 100 percent and 0.01 to 50 mm, as in 3,2".into()),
        }
    }

    fn side(&self) -> &'static str {
        if self.local { "local" } else { "global" }
    }
}

fn highest_gamma(highest: f64) -> String {
    match highest < gamma::HIGHEST {
        true => format!("{highest:.3}"),
        false => format!("{:.0} or more", gamma::HIGHEST),
    }
}

fn agreement(one: &ReadDose, other: &ReadDose, from_gy: f64, criterion: &Criterion) -> Option<Agreement> {
    let all = places_m(one).zip(one.dose_gy.iter().copied());
    let places: Vec<([f64; 3], f64)> = all.filter(|(_, gy)| *gy >= from_gy).collect();
    let gammas = criterion.gammas(&places, &|place| at_gy(other, place));
    Agreement::of(&gammas.into_iter().flatten().collect::<Vec<_>>())
}

fn difference(one: &ReadDose, other: &ReadDose, from_gy: f64) -> Option<Difference> {
    let mut found = Difference {
        compared: 0,
        outside: 0,
        mean_gy: 0.0,
        root_mean_square_gy: 0.0,
        largest_gy: 0.0,
        largest_at_mm: [0.0; 3],
    };
    for (place, gy) in places_m(one).zip(&one.dose_gy).filter(|(_, gy)| **gy >= from_gy) {
        let Some(other_gy) = at_gy(other, place) else {
            found.outside += 1;
            continue;
        };
        let difference = other_gy - gy;
        found.compared += 1;
        found.mean_gy += difference;
        found.root_mean_square_gy += difference * difference;
        if difference.abs() >= found.largest_gy.abs() {
            (found.largest_gy, found.largest_at_mm) = (difference, place.map(|m| m * 1e3));
        }
    }
    let count = found.compared as f64;
    (found.compared > 0).then(|| Difference {
        mean_gy: found.mean_gy / count,
        root_mean_square_gy: (found.root_mean_square_gy / count).sqrt(),
        ..found
    })
}
