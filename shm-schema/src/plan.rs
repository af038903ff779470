//! The plan kept by `rt-core`, independent of the connected hosts.

use crate::Text;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Most seeds, planned or placed.
pub const MAX_SEEDS: usize = 128;

/// Most earlier needles that a rehearsal with stabilising needles may name.
pub const MAX_EARLIER_NEEDLES: usize = 40;

/// One seed of a plan.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PlannedSeed {
    /// Position at rest, scene frame, m.
    pub position_m: [f64; 3],
}

/// Range of the strength of a planned seed, U.
pub const SEED_STRENGTH_RANGE_U: [f64; 2] = [0.0, 1e5];
/// Range of the prescribed dose, Gy.
pub const PRESCRIPTION_RANGE_GY: [f64; 2] = [0.0, 1e4];
/// Bytes of a source model's name.
pub const SOURCE_BYTES: usize = 32;
/// Most needles in a plan.
pub const MOST_PLANNED_NEEDLES: u32 = 1000;

/// Seed data of a planned needle, for other hosts that compute dose; the core passes it on. All zero if unknown.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
pub struct Prescribed {
    /// Number of the needle in its plan, from 1, whose seeds are dropped in order; 0 for a manual plan.
    pub needle: u32,
    /// The last needle of that plan that has seeds; 0 for a manual plan.
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
    /// Entry of the needle, m.
    pub entry_m: [f64; 3],
    /// Unit vector from the entry into the body.
    pub direction: [f64; 3],
    /// Positions of at most [`MAX_SEEDS`] seeds, m.
    pub seeds_m: Vec<[f64; 3]>,
    /// Seed data.
    #[serde(default)]
    pub prescribed: Prescribed,
}

impl PlannedNeedle {
    /// Returns the distance of a point from the entry, along the needle, m.
    pub fn along_m(&self, point_m: [f64; 3]) -> f64 {
        (0..3).map(|a| (point_m[a] - self.entry_m[a]) * self.direction[a]).sum()
    }
}

/// The needle's path and the seeds planned along it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PlanInForce {
    /// The run of the core.
    pub session_id: u64,
    /// Rises with each change; 0 means that there is no plan.
    pub generation: u64,
    /// The scene that was running when the plan arrived.
    pub scene_generation: u64,
    /// Start of the needle, outside the gland.
    pub entry_m: [f64; 3],
    /// Unit vector of the trajectory (r of paper eq. 6).
    pub direction: [f64; 3],
    /// Number of `seeds` in use.
    pub seed_count: u64,
    /// Seed data.
    pub prescribed: Prescribed,
    /// Seeds in the order in which the host sent them.
    pub seeds: [PlannedSeed; MAX_SEEDS],
}

impl PlanInForce {
    /// Returns the plan for hosts, without its session and generations; all zero for no plan.
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
