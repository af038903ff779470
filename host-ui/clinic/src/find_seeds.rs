//! The command `host-ui find-seeds`: seeds in a CT volume, as a table.

use super::CommandError;
use super::dose::common::within;
use super::dose::write;
use crate::finder::{self, Found, Search};
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};
use stylet_base::format::printable;
use stylet_base::output::new_folder;
use stylet_files::dicom::{self, Shared};
use stylet_files::image::read_values;
use stylet_files::together;
use stylet_files::{bytes, watched};
use stylet_implant::provenance;

/// Largest number of seeds in an implant.
const MOST_SEEDS: u64 = 400;

/// Most doubts on the terminal, those with the largest signals; `found.json` has all.
const MOST_LISTED: usize = 40;

const HELP: &str = "\
Voxels above a threshold are joined into components. Each is fitted by as many seeds as its signal (the sum of its excess over the
tissue) indicates, so that seeds that touch are split. With --count the total is the number that was implanted. Every seed gets a
position (mm, RAS), an axis, a confidence (probability of the count of its component times the share of the signal that the fit
explains) and the standard deviation of its position. Doubtful components are listed with their signal in seeds.

The CT is a DICOM series (its folder, or one of its files), NIfTI-1, NRRD or MetaImage in HU; crop it to the gland and its surroundings. Written to --out, a new or empty folder:
seeds.csv, which `host-ui dose --seeds` and `host-ui post-implant` read, and found.json.

Example:
  host-ui find-seeds day30.nii.gz --count 98 --out found
  host-ui dose --source sources/i125_6711.toml --seeds found/seeds.csv --strength-u 0.45 --structures day30.nrrd --out day30";

/// Options of `host-ui find-seeds`.
#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct FindSeedsArgs {
    /// CT of the implant: a DICOM series (its folder, or one of its files), NIfTI-1, NRRD, MetaImage
    ct: PathBuf,
    /// Number of implanted seeds, less those that were lost
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    count: Option<u64>,
    /// Smallest value of the voxels of seeds [default: from the data, and reported]
    #[arg(long, value_name = "HU", allow_negative_numbers = true)]
    threshold: Option<f64>,
    /// Length of a seed
    #[arg(long, value_name = "MM", default_value_t = 4.5)]
    length_mm: f64,
    /// Diameter of a seed
    #[arg(long, value_name = "MM", default_value_t = 0.8)]
    diameter_mm: f64,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl FindSeedsArgs {
    /// Executes the command.
    pub fn run(self) -> Result<(), CommandError> {
        within("--length-mm", self.length_mm, 1.0, 10.0)?;
        within("--diameter-mm", self.diameter_mm, 0.2, 3.0)?;
        let is_dicom = self.is_of_a_ct()?;
        let identity = together(&[Some(&self.ct)], Shared::Frame)?;
        let ct = watched(&self.ct, |progress| read_values(&self.ct, progress))?;
        let search = Search {
            threshold: self.threshold,
            count: self.count.map(|n| n as usize),
            length_m: self.length_mm * 1e-3,
            diameter_m: self.diameter_mm * 1e-3,
        };
        let found = finder::find(&ct, &search).map_err(|why| format!("{}: {why}", self.ct.display()))?;
        if let Some(note) = &ct.frame.warning {
            eprintln!("note: {}: {}", self.ct.display(), printable(note));
        }
        new_folder(&self.out)?;
        write::found_seeds(&self.out.join("seeds.csv"), identity.as_ref(), &found.seeds)?;
        write::json(&self.out.join("found.json"), &self.json(&found, is_dicom)?)?;
        self.print(&found);
        Ok(())
    }

    /// Refuses a DICOM series that is not in HU; returns whether it is DICOM at all.
    fn is_of_a_ct(&self) -> Result<bool, CommandError> {
        let Some((modality, unit)) = dicom::series::modality(&self.ct)? else {
            return Ok(false);
        };
        if modality != "CT" || !["", "HU"].contains(&unit.as_str()) {
            return Err(format!(
                "{}: its Modality is \"{modality}\" and its RescaleType \"{unit}\"; seeds are found in a CT, whose values are in HU",
                self.ct.display()
            )
            .into());
        }
        Ok(true)
    }

    fn print(&self, found: &Found) {
        let [tissue, noise] = found.tissue;
        let given = if self.threshold.is_some() {
            "given"
        } else {
            "from the data"
        };
        println!(
            "threshold {:.0} HU ({given}); tissue {tissue:.0} HU, noise {noise:.0} HU, blur {:.2} mm",
            found.threshold,
            found.blur_m * 1e3
        );
        println!(
            "{} components, {} of them split: {} seeds{}",
            found.components,
            found.split_components,
            found.seeds.len(),
            self.count.map_or_else(String::new, |n| format!(" of {n}"))
        );
        for doubt in found.doubts.iter().take(MOST_LISTED) {
            let [x, y, z] = doubt.place_m.map(|m| m * 1e3);
            println!(
                "doubtful: at {x:.1}, {y:.1}, {z:.1} mm, signal of {:.2} seeds, up to {:.0} HU, counted as {}: {}",
                doubt.signal, doubt.peak, doubt.counted, doubt.why
            );
        }
        if found.doubts.len() > MOST_LISTED {
            println!("doubtful: {} more in found.json", found.doubts.len() - MOST_LISTED);
        }
        if let Some(count) = self.count.filter(|n| *n != found.seeds.len() as u64) {
            eprintln!(
                "note: {} seeds are requested and the signal indicates {}; check the doubtful ones, or choose another --threshold",
                count,
                found.seeds.len()
            );
        }
        println!("written: {}", self.out.display());
    }

    fn json(&self, found: &Found, is_dicom: bool) -> Result<serde_json::Value, CommandError> {
        let mm = |place: [f64; 3]| place.map(|m| m * 1e3);
        let doubts = found
            .doubts
            .iter()
            .map(|d| json!({ "at_mm": mm(d.place_m), "signal_seeds": d.signal, "peak_hu": d.peak, "counted": d.counted, "why": d.why }));
        let mut inputs: Vec<(&str, &Path)> = vec![("ct", &self.ct)];
        // One file of a series selects all files in its folder.
        if is_dicom && self.ct.is_file() {
            inputs.push(("series", bytes::folder(&self.ct)));
        }
        Ok(json!({
            "seeds": found.seeds.len(),
            "asked": self.count,
            "threshold_hu": found.threshold,
            "threshold_is_given": self.threshold.is_some(),
            "tissue_hu": found.tissue[0],
            "noise_hu": found.tissue[1],
            "blur_mm": found.blur_m * 1e3,
            "components": found.components,
            "components_split": found.split_components,
            "doubtful": doubts.collect::<Vec<_>>(),
            "made": provenance::made(&inputs)?,
        }))
    }
}
