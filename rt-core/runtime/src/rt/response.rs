//! The tissue loop's response to the force loop.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_shm_schema::DeadlineTotals;
use stylet_sim::force::LocalResponse;
use stylet_sim::force::chain::Touch;
use stylet_sim::line::MAX_LEFT;
use stylet_sim::needle::LayerKind;

/// Contact of the tip and response of the body, once in each tissue tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct TissueResponse {
    /// When the tick began, `CLOCK_MONOTONIC`, ns.
    pub time_ns: u64,
    /// Ticks made so far.
    pub tick: u64,
    /// Number of the present contact; 0 for none.
    pub contact: u64,
    /// Entry of the tip into the body, scene frame, m.
    pub contact_in_scene: Vector3<f64>,
    /// r of eq. 6, kept for the whole contact; unit vector.
    pub path_direction: Vector3<f64>,
    /// The innermost layer met.
    pub layer: LayerKind,
    /// Number of that layer; rises over the run.
    pub layer_number: u64,
    /// Place at which its membrane was met, scene frame, m.
    pub layer_in_scene: Vector3<f64>,
    /// Response of the body at the tip.
    pub local: LocalResponse,
    /// Largest violation of a limit so far, in elements.
    pub worst_residual: f64,
    /// Smallest corner volume of an element near the tip, relative to rest, from the last tick; 1 where the tissue's
    /// answer is not linear.
    pub least_corner: f64,
    /// Displacement of the tissue at the tip when its linear answer folded, m; 0 if it has not since the insertion.
    pub folded_from_m: f64,
    /// Longest tick so far, ns.
    pub worst_work_ns: u64,
    /// Latest wake-up so far, ns.
    pub worst_wake_ns: u64,
    /// Deadlines missed so far.
    pub missed: u64,
    /// Totals since the loop began; no reset clears them.
    pub since_start: DeadlineTotals,
    /// Totals since the force was last turned on.
    pub since_armed: DeadlineTotals,
    /// Seeds in the tissue.
    pub seed_count: u32,
    /// Generation of the line whose columns the tissue loop has; 0 for none.
    pub line: u64,
    /// Read time of the pose that the tissue last answered within its tolerance, `CLOCK_MONOTONIC`, ns.
    pub solved_ns: u64,
    /// Tip of that pose, scene frame, m.
    pub solved_tip_in_scene: Vector3<f64>,
    /// Generations of the lines of needles that stay in whose columns it has; 0 for none.
    pub left: [u64; MAX_LEFT],
    /// Generation of the probe's displacement of the line; 0 if there was none yet.
    pub outside: u64,
    /// The step has not converged, and the needle would feel it.
    pub unsolved: bool,
}

impl TissueResponse {
    /// Returns where the tip meets tissue; valid during contact.
    pub fn touch(&self) -> Touch {
        Touch {
            contact_in_world: self.contact_in_scene,
            path_direction: self.path_direction,
            layer: self.layer,
            layer_number: self.layer_number,
            layer_in_world: self.layer_in_scene,
            local: self.local,
        }
    }
}

impl Default for TissueResponse {
    fn default() -> Self {
        Self {
            time_ns: 0,
            tick: 0,
            contact: 0,
            contact_in_scene: Vector3::zeros(),
            path_direction: Vector3::z(),
            layer: LayerKind::default(),
            layer_number: 0,
            layer_in_scene: Vector3::zeros(),
            local: LocalResponse::default(),
            worst_residual: 0.0,
            least_corner: 1.0,
            folded_from_m: 0.0,
            worst_work_ns: 0,
            worst_wake_ns: 0,
            missed: 0,
            since_start: DeadlineTotals::default(),
            since_armed: DeadlineTotals::default(),
            seed_count: 0,
            line: 0,
            solved_ns: 0,
            solved_tip_in_scene: Vector3::zeros(),
            left: [0; MAX_LEFT],
            outside: 0,
            unsolved: false,
        }
    }
}
