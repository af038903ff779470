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
pub mod rehearse;
pub mod seeds;
pub mod stabilise;
mod template;

pub use anatomy::Anatomy;
pub use compensate::{Compensation, Limits, compensate};
pub use edit::{History, Row};
pub use error::PlanError;
pub use needle::{Loading, Needle, NeedleSeed, SEED_LENGTH_M, SPACER_M};
pub use rehearse::{Drops, LinkRehearser, RehearsalError, Rehearser};
use stylet_dose as dose;
use stylet_shm_schema::{Prescribed, Text};
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

    /// Returns the seeds for dose computation, needle by needle, deepest first.
    pub fn seeds(&self) -> Vec<dose::Seed> {
        let of_needle = |n: &Needle| {
            let (axis, places) = (n.direction, n.seeds_m().collect::<Vec<_>>());
            let seed = move |(s, position_m): (&NeedleSeed, [f64; 3])| dose::Seed {
                position_m,
                axis: Some(axis),
                strength_u: s.strength_u,
            };
            n.seeds.iter().zip(places).map(seed).collect::<Vec<_>>()
        };
        self.needles.iter().flat_map(of_needle).collect()
    }
}
