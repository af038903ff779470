//! `host-ui dose --rt-dose`: figures of an imported dose, and a second check of it by TG-43U1.

use super::common::Loaded;
use super::{DoseArgs, POINTS_FOR_DOSE, write};
use crate::CommandError;
use serde_json::json;
use std::path::Path;
use stylet_base::format::printable_table;
use stylet_base::output::new_folder;
use stylet_base::progress_bar::LongTask;
use stylet_dose::report::{Judge, Verdict};
use stylet_dose::{DoseGrid, Structure};
use stylet_files::FileError;
use stylet_files::dicom::Identity;
use stylet_files::dicom::dose::DoseKind;
use stylet_implant::plan::seeds;
use stylet_implant::provenance;
use stylet_implant::readers::{read_any_dose, read_points};

/// Largest share of the target outside of the dose: beyond it, its figures would mean another body.
const MOST_OUTSIDE: f64 = 0.01;

/// Omissions of the second check.
const OMITTED: &str = "TG-43U1 gives the dose to water in unbounded water: shielding between seeds, tissue other than water, \
                       calcifications and the surface of the patient are left out";

/// Measure of both doses.
pub struct Checked {
    /// Structure, measure and unit.
    pub name: String,
    /// Value of the TG-43U1 dose.
    pub own: Option<f64>,
    /// Value of the imported dose.
    pub imported: Option<f64>,
}

impl Checked {
    /// Returns the imported value minus the own one.
    pub fn difference(&self) -> Option<f64> {
        Some(self.imported? - self.own?)
    }

    /// Returns the difference in percent of the own value.
    pub fn percent(&self) -> Option<f64> {
        let own = self.own.filter(|own| *own != 0.0)?;
        Some(self.difference()? / own * 100.0)
    }
}

impl DoseArgs {
    /// Evaluates the dose of a file, and compares it with that of the seeds if there are any.
    pub(super) fn run_imported(&self, file: &Path, identity: Option<&Identity>) -> Result<(), CommandError> {
        let c = &self.common;
        let drawn = self.structures.as_deref().ok_or("--rt-dose needs --structures FILE")?;
        let loaded = self.seeds.as_deref().map(|file| c.load(file)).transpose()?;
        let prescription_gy = c.prescription_gy(loaded.as_ref())?;
        let dose = read_any_dose(file)?;
        seeds::report(file, &dose.notes);
        seeds::report(file, &dose.other_references(self.seeds.as_deref(), Some(drawn)));
        if loaded.is_some() {
            let own = DoseKind::default();
            own.comparable(&dose.kind).map_err(|why| FileError::of(file, why))?;
        }
        let kind = dose.kind;
        let grid = DoseGrid::of(dose.origin_m, dose.spacing_m, dose.dims, dose.dose_gy)?;
        let points = self.points.as_deref().map(read_points).transpose()?.unwrap_or_default();
        if let Some(n) = points.iter().position(|point| !grid.has(*point)) {
            let place = points[n].map(|m| m * 1e3);
            return Err(format!(
                "{}: point {}, at {place:?} mm, is outside of its dose",
                file.display(),
                n + 1
            )
            .into());
        }
        let placed = loaded.as_ref().map_or(&[][..], |l| &l.seeds);
        let (structures, target) = c.structures(drawn, placed, POINTS_FOR_DOSE)?;
        let target = structures[target].name.clone();
        let (structures, outside) = inside(structures, &target, &grid).map_err(|why| FileError::of(file, why))?;
        seeds::report(file, &outside);
        let metrics = c.extra_metrics()?;
        let judge = Judge::new(
            structures,
            Some(&target),
            &metrics,
            prescription_gy,
            placed,
            POINTS_FOR_DOSE,
        )?;
        new_folder(&c.out)?;
        let imported = judge.judge_grid(&grid);
        let own = loaded.as_ref().map(|loaded| own_dose(&judge, loaded));
        let mut inputs: Vec<(&str, &Path)> = vec![("--rt-dose", file), ("--structures", drawn)];
        if let Some(seeds) = &self.seeds {
            inputs.extend([("--source", c.source()?), ("--seeds", seeds)]);
        }
        inputs.extend(self.points.as_deref().map(|file| ("--points", file)));
        let made = provenance::made(&inputs)?;
        if !points.is_empty() {
            let doses: Vec<f64> = points.iter().map(|place| grid.at_gy(*place)).collect();
            write::doses(&c.out.join("dose_points.csv"), identity, points.iter().copied(), &doses)?;
        }
        self.write_histograms(&judge, (&imported, own.as_ref()), prescription_gy)?;
        let mut figures = judge.to_json(&imported);
        figures["dose"] = json!({
            "type": kind.dose_type, "summation": kind.summation, "voxels": grid.dims(), "spacing_mm": grid.spacing_m().map(|m| m * 1e3),
            "outside": outside,
        });
        figures["made"] = made.clone();
        print!("{}", printable_table(&judge.table(&imported)));
        if let (Some(own), Some(loaded)) = (&own, &loaded) {
            let checked = checked(&judge, own, &imported);
            write::second_check(&c.out.join("second_check.csv"), &checked)?;
            figures["second_check"] = json!({
                "dose": c.provenance(&loaded.source, &loaded.seeds), "measures": write::checked_json(&checked), "left_out": OMITTED,
            });
            print!(
                "{}",
                printable_table(&write::checked_table(&loaded.source.model, &checked))
            );
            println!("note: {OMITTED}");
        }
        write::json(&c.out.join("metrics.json"), &figures)?;
        write::json(&c.out.join("made.json"), &made)?;
        println!("written: {}", c.out.display());
        Ok(())
    }
}

fn own_dose(judge: &Judge, loaded: &Loaded) -> Verdict {
    let what = format!("points have their dose of {} seeds", loaded.seeds.len());
    let task = LongTask::new(judge.points(), &what);
    judge.judge_reporting(&loaded.kernel, &loaded.seeds, &|done| task.advance(done))
}

fn checked(judge: &Judge, own: &Verdict, imported: &Verdict) -> Vec<Checked> {
    let pairs = judge.values(own).into_iter().zip(judge.values(imported));
    let of_pair = |((name, own), (_, imported))| Checked { name, own, imported };
    pairs.map(of_pair).collect()
}

/// Returns the parts of structures inside the dose, and a remark on each that reaches beyond it.
fn inside(structures: Vec<Structure>, target: &str, grid: &DoseGrid) -> Result<(Vec<Structure>, Vec<String>), String> {
    let (mut kept, mut notes) = (Vec::new(), Vec::new());
    for whole in structures {
        let points = whole.points_m.iter().zip(&whole.volumes_m3);
        let (points_m, volumes_m3) = points.filter(|(place, _)| grid.has(**place)).unzip();
        let part = Structure {
            name: whole.name.clone(),
            points_m,
            volumes_m3,
        };
        let (of, inside) = (whole.volume_m3(), part.volume_m3());
        let share = 1.0 - inside / of;
        let outside = format!(
            "{:.2} % of {} ({:.2} of {:.2} cc)",
            share * 100.0,
            whole.name,
            (of - inside) * 1e6,
            of * 1e6
        );
        if whole.name == target && share > MOST_OUTSIDE {
            return Err(format!(
                "{outside}, the target, are outside of the dose; export a dose that covers it"
            ));
        }
        if part.points_m.len() < whole.points_m.len() {
            let counted = if part.points_m.is_empty() {
                "it is left out"
            } else {
                "its figures are those of the rest"
            };
            notes.push(format!("{outside} are outside of the dose; {counted}"));
        }
        kept.extend((!part.points_m.is_empty()).then_some(part));
    }
    Ok((kept, notes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(name: &str, low_m: f64, high_m: f64) -> Structure {
        Structure::of_box(name, [low_m; 3], [high_m; 3], 1e-3)
    }

    /// A dose used to be counted only where its grid was, so that a structure beyond it had figures of another body.
    #[test]
    fn structures_beyond_the_dose_are_noted_and_targets_refused() {
        // Voxels from -1 to 19 mm along each axis.
        let grid = DoseGrid::new([0.0; 3], [2e-3; 3], [10; 3]).unwrap();
        let all = vec![
            cube("Prostate", 0.0, 0.018),
            cube("Rectum", 9e-3, 29e-3),
            cube("Bladder", 0.03, 0.04),
        ];
        let (kept, notes) = inside(all, "Prostate", &grid).unwrap();
        let names: Vec<&str> = kept.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["Prostate", "Rectum"]);
        assert!(
            (kept[1].volume_m3() * 1e6 - 1.0).abs() < 1e-6,
            "{}",
            kept[1].volume_m3()
        );
        assert_eq!(notes.len(), 2);
        assert!(
            notes[0].starts_with("87.50 % of Rectum (7.00 of 8.00 cc)"),
            "{}",
            notes[0]
        );
        assert!(
            notes[1].starts_with("100.00 % of Bladder") && notes[1].ends_with("it is left out"),
            "{}",
            notes[1]
        );
        let why = inside(vec![cube("PTV", 0.0, 0.02)], "PTV", &grid).unwrap_err();
        assert!(why.contains("the target, are outside of the dose"), "{why}");
    }
}
