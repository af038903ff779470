//! The implant: template, needles and seeds as plain values, with their operations. No window, no
//! shared memory.
//!
//! Lengths in m, scene frame; strength in U; files are in mm, in the patient's frame (RAS).

pub mod anatomy;
pub mod check;
pub mod compensate;
pub mod edit;
mod error;
pub mod exchange;
pub mod file;
pub mod first;
mod needle;
pub mod optimise;
mod problem;
pub mod rehearse;
pub mod seeds;
pub mod stabilise;
mod template;

pub use anatomy::Anatomy;
pub use compensate::{Compensation, Limits, compensate};
pub use edit::{History, Row};
pub use error::PlanError;
pub use needle::{Loading, Needle, NeedleSeed, SEED_LENGTH_M, SPACER_M, TOUCHING_M};
pub use problem::{FileProblem, SeedsProblem};
pub use rehearse::{Drops, LinkRehearser, RehearsalError, Rehearser};
use stylet_anatomy::PatientFrame;
use stylet_dose as dose;
use stylet_files::dicom::plan::PlanSeed;
use stylet_shm_schema::{PlannedNeedle, Prescribed, Text};
pub use template::{HOLES, Hole, NotAHole, PITCH_M, Template};

/// Plan of an implant, complete before the first needle goes in.
#[derive(Clone, Debug, PartialEq)]
pub struct ImplantPlan {
    /// Template of its needles.
    pub template: Template,
    /// Name of the source's model, as in its file.
    pub source: String,
    /// Prescribed dose, Gy.
    pub prescription_gy: f64,
    /// Needles in the order of insertion.
    pub needles: Vec<Needle>,
}

impl ImplantPlan {
    /// Returns the plan of one needle.
    pub fn of_one_needle(planned: &PlannedNeedle, template: Template) -> Self {
        let needle = file::through(&template, planned.entry_m, planned.direction);
        let seed = |place_m: &[f64; 3]| NeedleSeed {
            along_m: needle.along_m(*place_m),
            strength_u: planned.prescribed.strength_u,
        };
        let seeds = planned.seeds_m.iter().map(seed).collect();
        Self {
            template,
            source: planned.prescribed.source.read(),
            prescription_gy: planned.prescribed.dose_gy,
            needles: vec![Needle { seeds, ..needle }.in_order()],
        }
    }

    /// Returns the number of seeds of all needles.
    pub fn seed_count(&self) -> usize {
        self.needles.iter().map(|n| n.seeds.len()).sum()
    }

    /// Returns the index of its needle for each of [`ImplantPlan::seeds`].
    pub fn needle_of_seeds(&self) -> Vec<usize> {
        let of_needle = |(n, needle): (usize, &Needle)| vec![n; needle.seeds.len()];
        self.needles.iter().enumerate().flat_map(of_needle).collect()
    }

    /// Returns the prescription of a needle's seeds for other hosts, counted from 0. If strengths
    /// differ, the first one is given.
    pub fn prescribed(&self, needle: usize) -> Prescribed {
        let number = |n: usize| u32::try_from(n + 1).unwrap_or(0);
        let seeds = self.needles.get(needle).map_or(&[][..], |n| &n.seeds[..]);
        Prescribed {
            needle: number(needle),
            last_needle: self.needles.iter().rposition(|n| !n.seeds.is_empty()).map_or(0, number),
            strength_u: seeds.first().map_or(0.0, |seed| seed.strength_u),
            dose_gy: self.prescription_gy,
            source: Text::new(&self.source),
        }
    }

    /// Returns a needle, counted from 0, for other hosts; `None` if there is no such needle.
    pub fn planned(&self, number: usize) -> Option<PlannedNeedle> {
        let needle = self.needles.get(number)?;
        Some(PlannedNeedle {
            entry_m: needle.entry_m,
            direction: needle.direction,
            seeds_m: needle.seeds_m().collect(),
            prescribed: self.prescribed(number),
        })
    }

    /// Returns the seeds for dose computation, needle by needle, deepest first.
    pub fn seeds(&self) -> Vec<dose::Seed> {
        self.needles.iter().flat_map(Needle::dose_seeds).collect()
    }

    /// Returns the seeds in the patient's frame with the number and hole of their needle.
    pub fn rows(&self, patient: &PatientFrame) -> Vec<PlanSeed> {
        let of_needle = |(number, needle): (u32, &Needle)| {
            let hole = needle.hole.map_or_else(String::new, |h| h.to_string());
            let axis = Some(patient.patient_from_scene_direction(needle.direction));
            let row = |seed: dose::Seed| PlanSeed {
                needle: Some(number),
                hole: hole.clone(),
                position_m: patient.patient_from_scene(seed.position_m),
                axis,
                strength_u: seed.strength_u,
                strength_on: None,
            };
            needle.dose_seeds().map(row).collect::<Vec<_>>()
        };
        (1..).zip(&self.needles).flat_map(of_needle).collect()
    }
}
