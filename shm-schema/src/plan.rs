//! The plan that `rt-core` keeps, whichever hosts are connected.

use crate::Text;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Seeds planned or placed at most.
pub const MAX_SEEDS: usize = 128;

/// Needles, at most, that a rehearsal beside those that stay in may name as having been there before.
pub const MAX_EARLIER_NEEDLES: usize = 40;

/// One seed of a plan.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PlannedSeed {
    /// Position at rest, scene frame, m.
    pub position_m: [f64; 3],
}

/// Strength of a planned seed, U.
pub const SEED_STRENGTH_RANGE_U: [f64; 2] = [0.0, 1e5];
/// Prescribed dose, Gy.
pub const PRESCRIPTION_RANGE_GY: [f64; 2] = [0.0, 1e4];
/// Bytes of the model of a source.
pub const SOURCE_BYTES: usize = 32;
/// Needles of a plan of many.
pub const MOST_PLANNED_NEEDLES: u32 = 1000;

/// What the seeds of a planned needle are, for other hosts that count their dose; the core passes it on. All zero where it is not known.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
pub struct Prescribed {
    /// Which needle of a plan of many it is, counted from 1, and its seeds are dropped in their order; 0 for one by hand.
    pub needle: u32,
    /// The last needle of that plan that has seeds; 0 for one by hand.
    pub last_needle: u32,
    /// Strength of each seed, U.
    pub strength_u: f64,
    /// Prescribed dose, Gy.
    pub dose_gy: f64,
    /// Model of the source.
    pub source: Text<SOURCE_BYTES>,
}

impl Default for Prescribed {
    fn default() -> Self {
        Self::zeroed()
    }
}

/// A needle and the seeds along it, scene frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedNeedle {
    /// Where the needle enters, m.
    pub entry_m: [f64; 3],
    /// Unit vector from the entry into the body.
    pub direction: [f64; 3],
    /// Positions of at most [`MAX_SEEDS`] seeds, m.
    pub seeds_m: Vec<[f64; 3]>,
    /// What the seeds are.
    #[serde(default)]
    pub prescribed: Prescribed,
}

/// The needle's path and the seeds planned along it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PlanInForce {
    /// The run of the core.
    pub session_id: u64,
    /// Rises with each change; 0 means that there is no plan.
    pub generation: u64,
    /// The scene that was running when the plan came.
    pub scene_generation: u64,
    /// Where the needle starts, outside the gland.
    pub entry_m: [f64; 3],
    /// Unit vector of the trajectory (r of paper eq. 6).
    pub direction: [f64; 3],
    /// How many of `seeds` count.
    pub seed_count: u64,
    /// What they are.
    pub prescribed: Prescribed,
    /// In the order in which the host sent them.
    pub seeds: [PlannedSeed; MAX_SEEDS],
}

impl PlanInForce {
    /// Returns the plan that hosts get, without its session and generations; all zero for no plan.
    pub fn of(plan: Option<&PlannedNeedle>) -> Self {
        let mut sent = Self::zeroed();
        let Some(plan) = plan else { return sent };
        (sent.entry_m, sent.direction, sent.prescribed) = (plan.entry_m, plan.direction, plan.prescribed);
        for (seed, &position_m) in sent.seeds.iter_mut().zip(&plan.seeds_m) {
            seed.position_m = position_m;
        }
        sent.seed_count = plan.seeds_m.len().min(MAX_SEEDS) as u64;
        sent
    }

    /// Returns the planned needle.
    pub fn needle(&self) -> PlannedNeedle {
        let seeds = self.seeds.iter().take(self.seed_count as usize);
        PlannedNeedle {
            entry_m: self.entry_m,
            direction: self.direction,
            seeds_m: seeds.map(|seed| seed.position_m).collect(),
            prescribed: self.prescribed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planned_needle_survives_and_no_plan_is_all_zero() {
        let needle = PlannedNeedle {
            entry_m: [0.0, 0.0, -0.01],
            direction: [0.0, 0.0, 1.0],
            seeds_m: vec![[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]],
            prescribed: Prescribed {
                strength_u: 0.5,
                ..Default::default()
            },
        };
        assert_eq!(PlanInForce::of(Some(&needle)).needle(), needle);
        assert_eq!(PlanInForce::of(None), PlanInForce::zeroed());
    }
}
