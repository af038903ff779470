//! Instructor-injected faults in the force loop: device loss, patient shift.
//!
//! Device, template and hand stay in place; the body moves. Everything that meets tissue is in the scene's body frame,
//! and the hand is in the device's frame: the two differ by the displacement of the body.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_hw::{DeviceFault, Sample};

/// Speed of the patient. A jump would tear tissue around an inserted needle.
const BODY_M_PER_S: f64 = 5e-3;

/// Faults in force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PutIn {
    /// The device counts as disconnected, whatever it answers.
    pub device_lost: bool,
    /// Displacement of the body from its place in the scene, scene frame, m.
    pub body_moved_m: Vector3<f64>,
    /// Target of that displacement.
    pub body_to_m: Vector3<f64>,
}

impl PutIn {
    /// Returns the answer that the loop uses for the device's.
    pub fn answer(&self, read: Result<Sample, DeviceFault>) -> Result<Sample, DeviceFault> {
        if self.device_lost {
            return Err(DeviceFault::NotConnected);
        }
        read
    }

    /// Converts a sample from the device to the scene's body frame.
    pub fn in_body(&self, mut sample: Sample) -> Sample {
        sample.tip_in_world = moved(sample.tip_in_world, -self.body_moved_m);
        sample
    }

    /// Converts a point of the body to the scene frame.
    pub fn in_scene(&self, place_m: Vector3<f64>) -> Vector3<f64> {
        moved(place_m, self.body_moved_m)
    }

    /// Moves the patient for one tick.
    pub fn step(&mut self, dt_s: f64) {
        let way_m = self.body_to_m - self.body_moved_m;
        let (length_m, most_m) = (way_m.norm(), BODY_M_PER_S * dt_s);
        self.body_moved_m = match length_m <= most_m {
            true => self.body_to_m,
            false => self.body_moved_m + way_m * (most_m / length_m),
        };
    }
}

/// Bit-identical if nothing has moved, even for a negative zero.
pub fn moved(place_m: Vector3<f64>, by_m: Vector3<f64>) -> Vector3<f64> {
    match by_m == Vector3::zeros() {
        true => place_m,
        false => place_m + by_m,
    }
}
