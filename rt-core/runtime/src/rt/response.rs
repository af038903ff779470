//! What the tissue loop hands to the force loop.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_sim::force::LocalResponse;
use stylet_sim::force::chain::Touch;
use stylet_sim::needle::LayerKind;

/// Tissue to haptic, each tissue tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct TissueResponse {
    pub time_ns: u64,
    pub tick: u64,
    /// Number of the contact that lasts; 0 for none.
    pub contact: u64,
    pub contact_in_scene: Vector3<f64>,
    /// r of eq. 6, kept for the whole contact.
    pub path_direction: Vector3<f64>,
    /// The innermost layer met, under a number that rises over the run, and where.
    pub layer: LayerKind,
    pub layer_number: u64,
    pub layer_in_scene: Vector3<f64>,
    /// What the body answers at the tip.
    pub local: LocalResponse,
    pub worst_residual: f64,
    pub worst_work_ns: u64,
    pub worst_wake_ns: u64,
    pub missed: u64,
    pub seed_count: u32,
    pub unsolved: bool,
}

impl TissueResponse {
    /// Where the tip meets tissue; means something while there is contact.
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
            worst_work_ns: 0,
            worst_wake_ns: 0,
            missed: 0,
            seed_count: 0,
            unsolved: false,
        }
    }
}
