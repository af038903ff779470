//! What the force loop hands to the tissue loop.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_sim::needle::Phase;

/// Haptic to tissue, each tick: the newest pose.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct TipPose {
    pub time_ns: u64,
    pub tip_in_scene: Vector3<f64>,
    pub direction: Vector3<f64>,
    /// Inwards along the needle, filtered.
    pub speed_along_m_per_s: f64,
    pub phase: Phase,
    pub punctured: bool,
    /// Sum of the held element's steps (eq. 6) since the loop began; its differences drive the tissue.
    pub held_travel_m: Vector3<f64>,
    /// The last contact that the haptic loop has ended.
    pub released_contact: u64,
    /// Number of the innermost layer that the shaft is in, and the largest number taken up so far.
    pub innermost_layer: u64,
    pub seen_layer: u64,
}

impl Default for TipPose {
    fn default() -> Self {
        Self {
            time_ns: 0,
            tip_in_scene: Vector3::zeros(),
            direction: Vector3::z(),
            speed_along_m_per_s: 0.0,
            phase: Phase::Outside,
            punctured: false,
            held_travel_m: Vector3::zeros(),
            released_contact: 0,
            innermost_layer: 0,
            seen_layer: 0,
        }
    }
}
