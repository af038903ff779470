//! Faults that an instructor puts in, as the force loop has them: a device that counts as lost, a patient who has moved.
//!
//! Device, template and hand stand still; the body moves. Everything that meets tissue is in the body as the scene has it, and what
//! the hand does is where the device says: the two differ by how far the body has moved.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_hw::{DeviceFault, Sample};

/// How fast a patient moves. A jump would tear a needle that is in.
const BODY_M_PER_S: f64 = 5e-3;

/// What is in force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PutIn {
    /// The device counts as disconnected, whatever it answers.
    pub device_lost: bool,
    /// Where the body is, from where the scene has it, scene frame, m.
    pub body_moved_m: Vector3<f64>,
    /// Where it goes.
    pub body_to_m: Vector3<f64>,
}

impl PutIn {
    /// What the loop is to believe that the device answered.
    pub fn answer(&self, read: Result<Sample, DeviceFault>) -> Result<Sample, DeviceFault> {
        if self.device_lost {
            return Err(DeviceFault::NotConnected);
        }
        read
    }

    /// A place of the device, in the body as the scene has it.
    pub fn in_body(&self, mut sample: Sample) -> Sample {
        sample.tip_in_world = moved(sample.tip_in_world, -self.body_moved_m);
        sample
    }

    /// Where a place of the body is.
    pub fn in_scene(&self, place_m: Vector3<f64>) -> Vector3<f64> {
        moved(place_m, self.body_moved_m)
    }

    /// The patient moves on, for one tick.
    pub fn step(&mut self, dt_s: f64) {
        let way_m = self.body_to_m - self.body_moved_m;
        let (length_m, most_m) = (way_m.norm(), BODY_M_PER_S * dt_s);
        self.body_moved_m = match length_m <= most_m {
            true => self.body_to_m,
            false => self.body_moved_m + way_m * (most_m / length_m),
        };
    }
}

/// Bit-identical where nothing has moved, a negative zero as well.
pub fn moved(place_m: Vector3<f64>, by_m: Vector3<f64>) -> Vector3<f64> {
    match by_m == Vector3::zeros() {
        true => place_m,
        false => place_m + by_m,
    }
}
