//! What a tip of the needle's radius moves of its own shaft, beyond what its patch on the lattice moves.

use serde::{Deserialize, Serialize};

/// Length of the table, in radii of the patch: beyond it less than 1 % is left.
const REACH: f64 = 5.0;
const STEPS: usize = 256;

/// Displacement of the needle's surface by a sphere of its radius, less that by a sphere of the patch's radius, over
/// that in its middle; by the distance along the needle.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NearTip {
    step_m: f64,
    /// Integral from the middle on, m.
    integral_m: Vec<f64>,
}

impl NearTip {
    /// Makes the table for a medium of this Poisson's ratio; empty where the patch is as narrow as the needle.
    pub fn new(radius_m: f64, patch_radius_m: f64, nu: f64) -> Self {
        if patch_radius_m <= radius_m {
            return Self::default();
        }
        let step_m = REACH * patch_radius_m / STEPS as f64;
        let within = (10.0 / 3.0 - 4.0 * nu) * (1.0 / radius_m - 1.0 / patch_radius_m);
        let sphere = |of_m, z_m| integral_of_sphere(of_m, radius_m, nu, z_m);
        let at = |n: usize| {
            let z_m = n as f64 * step_m;
            (sphere(radius_m, z_m) - sphere(patch_radius_m, z_m)) / within
        };
        NearTip {
            step_m,
            integral_m: (0..=STEPS).map(at).collect(),
        }
    }

    /// Returns the mean over a stretch of the needle, from the tip's middle on.
    pub fn mean(&self, from_m: f64, to_m: f64) -> f64 {
        (self.integral_m(to_m) - self.integral_m(from_m)) / (to_m - from_m)
    }

    /// Returns the stations of the shaft that it reaches from a tip there.
    pub fn stations(&self, tip_m: f64, spacing_m: f64, in_contact: usize) -> std::ops::Range<usize> {
        let first = ((tip_m - self.step_m * STEPS as f64) / spacing_m).max(0.0) as usize;
        let end = if self.integral_m.is_empty() { 0 } else { in_contact };
        first.min(end)..end
    }

    fn integral_m(&self, to_m: f64) -> f64 {
        let Some(last_m) = self.integral_m.last() else {
            return 0.0;
        };
        let place = to_m.abs() / self.step_m;
        let at = place as usize;
        let pair = self.integral_m.get(at..).and_then(|rest| rest.get(..2));
        // Not `fract`, which is a call: not every processor that this is built for has an instruction for it.
        let size_m = pair.map_or(*last_m, |pair| pair[0] + (place - at as f64) * (pair[1] - pair[0]));
        size_m.copysign(to_m)
    }

    /// Returns whether it is a table, or none.
    pub(super) fn is_whole(&self) -> bool {
        let is_table = self.integral_m.len() == STEPS + 1 && self.step_m > 0.0;
        (is_table || self.integral_m.is_empty()) && self.integral_m.iter().all(|m| m.is_finite())
    }
}

/// Returns the integral, along the needle's surface from the sphere's middle on, of how an evenly loaded sphere moves
/// an endless medium; over `1 / (16 pi G (1 - nu))`.
fn integral_of_sphere(sphere_m: f64, needle_m: f64, nu: f64, z_m: f64) -> f64 {
    // Inside, the sphere moves as a rigid one.
    let rim_m = (sphere_m * sphere_m - needle_m * needle_m).max(0.0).sqrt();
    let beyond = |z_m: f64| {
        let (a, r) = (needle_m, z_m.hypot(needle_m));
        (4.0 - 4.0 * nu) * (z_m / a).asinh() - z_m / r
            + sphere_m * sphere_m / 3.0 * (z_m / (a * a * r) - z_m.powi(3) / (a * a * r.powi(3)))
    };
    let within_m = z_m.min(rim_m);
    (10.0 / 3.0 - 4.0 * nu) / sphere_m * within_m + beyond(z_m.max(rim_m)) - beyond(rim_m)
}

#[cfg(test)]
mod tests;
