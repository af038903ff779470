//! The newest pose of the needle, from the force loop to the tissue loop.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_sim::needle::Phase;

/// The newest pose of the needle, once in each tick of the force loop.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct TipPose {
    /// When the pose was read, `CLOCK_MONOTONIC`, ns; 0 for no pose yet.
    pub time_ns: u64,
    /// Displacement of the body from its place in the scene, m. The rest of the pose is relative to the body's place in
    /// the scene.
    pub body_moved_m: Vector3<f64>,
    /// Place of the tip, scene frame, m.
    pub tip_in_scene: Vector3<f64>,
    /// Direction of the needle, unit vector.
    pub direction: Vector3<f64>,
    /// Speed inwards along the needle, filtered, m/s.
    pub speed_along_m_per_s: f64,
    /// Phase of eq. 6.
    pub phase: Phase,
    /// The innermost membrane met is open.
    pub punctured: bool,
    /// Sum of the held element's steps (eq. 6) since the loop began, m; its differences drive the tissue.
    pub held_travel_m: Vector3<f64>,
    /// Number of the last contact that the force loop has ended.
    pub released_contact: u64,
    /// Number of the innermost layer that the shaft is in.
    pub innermost_layer: u64,
    /// Largest layer number that the force loop has seen.
    pub seen_layer: u64,
    /// The hand holds no needle: contact is disabled.
    pub hand_is_empty: bool,
}

impl Default for TipPose {
    fn default() -> Self {
        Self {
            time_ns: 0,
            body_moved_m: Vector3::zeros(),
            tip_in_scene: Vector3::zeros(),
            direction: Vector3::z(),
            speed_along_m_per_s: 0.0,
            phase: Phase::Outside,
            punctured: false,
            held_travel_m: Vector3::zeros(),
            released_contact: 0,
            innermost_layer: 0,
            seen_layer: 0,
            hand_is_empty: false,
        }
    }
}
