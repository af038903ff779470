//! The command `host-ui post-implant`: comparison of an implant as planned, as delivered, on day 0
//! and on day 30.

use super::CommandError;
use super::dose::common::{Common, EdemaArgs, Loaded, within};
use super::dose::{POINTS_FOR_DOSE, write};
use crate::sheet::{self, Column, Implant, State};
use clap::Args;
use std::path::{Path, PathBuf};
use stylet_base::output::new_folder;
use stylet_base::write_whole;
use stylet_dose::decay::days_to_s;
use stylet_dose::{Seed, Structure};
use stylet_files::bytes::file_name;
use stylet_files::dicom::Shared;
use stylet_files::together;
use stylet_implant::provenance;
use stylet_implant::registration::RigidFit;

const HELP: &str = "\
Seeds are those of `host-ui dose --seeds`; those of a CT come from `host-ui find-seeds`. A state with structures of its own
(--day0-structures, --day30-structures) is evaluated in its own frame. Without them its seeds are fitted to those of the plan (a
rotation and a shift, seeds paired one to one) and evaluated in the structures of the plan, with a note on the page; the residuals are
reported.

With --edema every state gets a second column: the dose in a gland that swells by that share of its volume at the implant and shrinks
with --edema-half-life, together with its seeds. Planned and delivered seeds have their positions in the gland without edema, those of
day 0 and day 30 their positions on that day.

Written to --out, a new or empty folder: post_implant.html (one page, A4), post_implant.csv, post_implant.json.

Example:
  host-ui post-implant --source sources/i125_6711.toml --planned plan.toml --structures gland.nrrd --day30 found/seeds.csv \\
      --day30-structures day30.nrrd --strength-u 0.45 --edema 40 --edema-half-life 9.3 --out post";

/// Options of `host-ui post-implant`.
#[derive(Args, Debug)]
#[command(after_long_help = HELP)]
pub struct PostImplantArgs {
    #[command(flatten)]
    common: Common,
    /// Planned seeds: CSV, a plan of host-ui (.toml), or a DICOM RT Plan
    #[arg(long, value_name = "FILE")]
    planned: PathBuf,
    /// Structures of the plan: NIfTI-1, NRRD, MetaImage, DICOM RT Structure Set or Segmentation
    #[arg(long, value_name = "FILE")]
    structures: PathBuf,
    /// Delivered seeds, in the frame of the plan
    #[arg(long, value_name = "FILE")]
    delivered: Option<PathBuf>,
    /// Seeds found on the day of the implant
    #[arg(long, value_name = "FILE")]
    day0: Option<PathBuf>,
    /// Structures of that day, in the frame of its seeds
    #[arg(long, value_name = "FILE", requires = "day0")]
    day0_structures: Option<PathBuf>,
    /// Seeds found about a month later
    #[arg(long, value_name = "FILE")]
    day30: Option<PathBuf>,
    /// Structures of that day, in the frame of its seeds
    #[arg(long, value_name = "FILE", requires = "day30")]
    day30_structures: Option<PathBuf>,
    /// Days after the implant on which --day30 was imaged
    #[arg(long, value_name = "DAYS", default_value_t = 30.0, requires = "day30")]
    imaged_after: f64,
    #[command(flatten)]
    swelling: EdemaArgs,
}

/// Seeds and structures of the plan, the reference of the other states.
struct Planned {
    places_m: Vec<[f64; 3]>,
    structures: Vec<Structure>,
    target: usize,
}

impl PostImplantArgs {
    /// Executes the command.
    pub fn run(self) -> Result<(), CommandError> {
        let c = &self.common;
        within("--imaged-after", self.imaged_after, 0.0, 400.0)?;
        let edema = c.edema(&self.swelling)?;
        self.compare_files()?;
        let loaded = c.load(&self.planned)?;
        let (structures, target) = c.structures(&self.structures, &loaded.seeds, POINTS_FOR_DOSE / 3)?;
        let implant = Implant {
            title: file_name(&self.planned),
            source: loaded.source.clone(),
            prescription_gy: c.prescription_gy(&loaded)?,
            calibrated: c.calibrated(&loaded),
            edema,
            is_for_ever: c.is_for_ever(),
        };
        let planned = Planned {
            places_m: loaded.seeds.iter().map(|s| s.position_m).collect(),
            structures,
            target,
        };
        // Long after any edema: planned and delivered seeds are in the gland as imaged before.
        let settled_s = f64::INFINITY;
        let mut states = vec![planned.state("planned", &self.planned, settled_s, loaded.seeds.clone(), None)];
        if let Some(file) = &self.delivered {
            let seeds = c.load(file)?.seeds;
            states.push(planned.state("delivered", file, settled_s, seeds, None));
        }
        let later = [
            ("day 0", 0.0, &self.day0, &self.day0_structures),
            (
                &*format!("day {:.0}", self.imaged_after),
                self.imaged_after,
                &self.day30,
                &self.day30_structures,
            ),
        ];
        for (name, days, file, structures) in later {
            if let Some(file) = file {
                let of_day = c.load(file)?;
                states.push(self.later(&planned, (name, days_to_s(days)), file, structures.as_deref(), &of_day)?);
            }
        }
        new_folder(&c.out)?;
        let mut columns = Vec::new();
        for state in states {
            let again = edema.map(|edema| (state.clone(), edema));
            columns.push(Column::of(&implant, &loaded.kernel, state, None));
            columns.extend(again.map(|(state, edema)| Column::of(&implant, &loaded.kernel, state, Some(edema))));
        }
        self.write(&implant, &columns)
    }

    /// Compares the files: all are of one patient, those of one day in one frame of reference.
    fn compare_files(&self) -> Result<(), CommandError> {
        let of_plan = [
            Some(self.planned.as_path()),
            Some(&self.structures),
            self.delivered.as_deref(),
        ];
        let day0 = [self.day0.as_deref(), self.day0_structures.as_deref()];
        let day30 = [self.day30.as_deref(), self.day30_structures.as_deref()];
        for of_day in [of_plan.as_slice(), &day0, &day30] {
            together(of_day, Shared::Frame)?;
        }
        for of_day in [day0, day30] {
            together(&[of_plan.as_slice(), &of_day].concat(), Shared::Patient)?;
        }
        Ok(())
    }

    /// Reads the seeds of a day after the implant: in structures of their own, or fitted to the
    /// plan.
    fn later(
        &self,
        planned: &Planned,
        (name, seen_s): (&str, f64),
        file: &Path,
        structures: Option<&Path>,
        loaded: &Loaded,
    ) -> Result<State, CommandError> {
        let found: Vec<[f64; 3]> = loaded.seeds.iter().map(|s| s.position_m).collect();
        let fit = RigidFit::of(&planned.places_m, &found).map_err(|why| format!("{}: {why}", file.display()))?;
        let [mean, _, worst] = fit.residual_figures_m().map(|m| m * 1e3);
        println!(
            "{name}: {} of {} seeds paired with the plan, {mean:.2} mm off on average, {worst:.2} mm at most; extent {:.3} of the plan's",
            fit.residuals_m.len(),
            planned.places_m.len(),
            fit.stretch
        );
        if let Some(own) = structures {
            let (structures, target) = self.common.structures(own, &loaded.seeds, POINTS_FOR_DOSE / 3)?;
            return Ok(State {
                name: name.to_owned(),
                file: file_name(file),
                structures_are: format!("in its own outlines ({})", file_name(own)),
                seen_s,
                seeds: loaded.seeds.clone(),
                structures,
                target,
                fit: Some(fit),
            });
        }
        let moved = |seed: &Seed| Seed {
            position_m: fit.place_m(seed.position_m),
            axis: seed.axis.map(|axis| fit.direction(axis)),
            ..*seed
        };
        let seeds = loaded.seeds.iter().map(moved).collect();
        Ok(planned.state(name, file, seen_s, seeds, Some(fit)))
    }

    fn write(&self, implant: &Implant, columns: &[Column]) -> Result<(), CommandError> {
        let out = &self.common.out;
        let mut inputs: Vec<(&str, &Path)> = vec![
            ("--source", self.common.source()?),
            ("--planned", &self.planned),
            ("--structures", &self.structures),
        ];
        let others = [
            ("--delivered", &self.delivered),
            ("--day0", &self.day0),
            ("--day0-structures", &self.day0_structures),
            ("--day30", &self.day30),
            ("--day30-structures", &self.day30_structures),
        ];
        inputs.extend(
            others
                .into_iter()
                .filter_map(|(option, file)| Some((option, file.as_deref()?))),
        );
        let mut value = sheet::to_json(implant, columns);
        value["made"] = provenance::made(&inputs)?;
        write::json(&out.join("post_implant.json"), &value)?;
        let names: Vec<&str> = columns.iter().map(|c| c.name.as_str()).collect();
        let rows = sheet::rows(implant, columns);
        write::figures(&out.join("post_implant.csv"), &names, &rows)?;
        write_whole(
            &out.join("post_implant.html"),
            sheet::page(implant, columns)?.as_bytes(),
        )?;
        print!(
            "{}",
            stylet_base::format::printable_table(&write::figure_table(&names, &rows))
        );
        println!("written: {}", out.display());
        Ok(())
    }
}

impl Planned {
    /// Evaluates seeds in the structures of the plan.
    fn state(&self, name: &str, file: &Path, seen_s: f64, seeds: Vec<Seed>, fit: Option<RigidFit>) -> State {
        State {
            name: name.to_owned(),
            file: file_name(file),
            structures_are: match fit {
                Some(_) => "fitted to the plan, in the outlines of the plan".to_owned(),
                None => "in the outlines of the plan".to_owned(),
            },
            seen_s,
            seeds,
            structures: self.structures.clone(),
            target: self.target,
            fit,
        }
    }
}
