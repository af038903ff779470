//! What came of a needle that the core went through ahead of time.

use crate::{MAX_SEEDS, SceneId, SeedPose};
use bytemuck::{Pod, Zeroable};

/// The result of one [`crate::Request::Rehearse`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Rehearsal {
    /// The run of the core.
    pub session_id: u64,
    /// The host that asked.
    pub host_id: u64,
    /// Its number for the request.
    pub command_id: u64,
    /// The scene that it was done in.
    pub scene_generation: u64,
    /// Time that passed for needle and tissue, and for the machine.
    pub simulated_ns: u64,
    /// Time that the machine took for it.
    pub wall_ns: u64,
    /// Largest force on the hand, after the gate.
    pub peak_force_n: f64,
    /// How far any tissue moved before the first membrane gave way.
    pub displacement_before_puncture_m: f64,
    /// Largest deflection of the tip from where a rigid needle would have it.
    pub deflection_m: f64,
    /// How many of `seeds` and `dropped_after_ns` count.
    pub seed_count: u64,
    /// Where the seeds rest, in the order of the drops.
    pub seeds: [SeedPose; MAX_SEEDS],
    /// When each was dropped, after the tip's first contact with tissue.
    pub dropped_after_ns: [u64; MAX_SEEDS],
}

impl Rehearsal {
    /// Identity of the scene that it was done in.
    pub fn scene_id(&self) -> SceneId {
        SceneId {
            session_id: self.session_id,
            generation: self.scene_generation,
        }
    }
}
