//! The plan that `rt-core` keeps for hosts that come and go.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Seeds planned or placed at most.
pub const MAX_SEEDS: usize = 128;

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.PlannedSeed")]
pub struct PlannedSeed {
    pub position_m: [f64; 3],
}

/// The needle's path and the seeds planned along it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.PlanInForce")]
pub struct PlanInForce {
    pub session_id: u64,
    /// Rises with each change; 0 means that there is no plan.
    pub generation: u64,
    pub scene_generation: u64,
    /// Where the needle starts, outside the gland.
    pub entry_m: [f64; 3],
    /// Unit vector of the trajectory (r of paper eq. 6).
    pub direction: [f64; 3],
    pub seed_count: u64,
    pub seeds: [PlannedSeed; MAX_SEEDS],
}
