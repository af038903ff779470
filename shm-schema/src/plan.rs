//! The plan that `rt-core` keeps, whichever hosts are connected.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Seeds planned or placed at most.
pub const MAX_SEEDS: usize = 128;

/// Needles that may stay in the tissue while another moves, at most.
pub const MAX_LEFT_NEEDLES: usize = 4;
/// Needles, at most, that a rehearsal beside those that stay in may name as having been there before.
pub const MAX_EARLIER_NEEDLES: usize = 40;

/// One seed of a plan.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.PlannedSeed")]
pub struct PlannedSeed {
    /// Position at rest, scene frame, m.
    pub position_m: [f64; 3],
}

/// The needle's path and the seeds planned along it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.PlanInForce")]
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
    /// In the order in which the host sent them.
    pub seeds: [PlannedSeed; MAX_SEEDS],
}
