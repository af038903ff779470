//! Result of a needle simulated ahead of time.

use crate::{MAX_SEEDS, SceneId, SeedPose};
use bytemuck::{Pod, Zeroable};

/// The result of one [`crate::Request::Rehearse`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Rehearsal {
    /// The run of the core.
    pub session_id: u64,
    /// The requesting host.
    pub host_id: u64,
    /// Its number for the request.
    pub command_id: u64,
    /// The scene of the rehearsal.
    pub scene_generation: u64,
    /// Simulated time.
    pub simulated_ns: u64,
    /// Time that the machine took.
    pub wall_ns: u64,
    /// Largest force on the hand, after the gate.
    pub peak_force_n: f64,
    /// Largest displacement of tissue before the first membrane gave way.
    pub displacement_before_puncture_m: f64,
    /// Largest deflection of the tip from a rigid needle's.
    pub deflection_m: f64,
    /// Number of `seeds` and `dropped_after_ns` in use.
    pub seed_count: u64,
    /// Seeds at rest, in the order of the drops.
    pub seeds: [SeedPose; MAX_SEEDS],
    /// Times of the drops after the tip's first contact with tissue.
    pub dropped_after_ns: [u64; MAX_SEEDS],
}

impl Rehearsal {
    /// Identity of the scene of the rehearsal.
    pub fn scene_id(&self) -> SceneId {
        SceneId {
            session_id: self.session_id,
            generation: self.scene_generation,
        }
    }
}
