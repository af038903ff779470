//! What a tip of the needle's radius moves of its own shaft, beyond what its patch on the lattice moves.

use serde::{Deserialize, Serialize};

/// Length of the table, in radii of the patch: beyond it less than 1 % is left.
const REACH: f64 = 5.0;
const STEPS: usize = 256;

/// Edge of a cube whose even load moves it on average as the same force moves a rigid sphere of radius 1: the mean of 1
/// / r over all pairs of points of a unit cube.
pub(super) const CUBE_PER_RADIUS: f64 = 1.882_312_645;
/// Samples across that cube. It moves the shaft in its middle by a quarter more than it moves on average, so no sphere
/// can stand for it there.
const ACROSS: usize = 16;

/// Displacement of the needle's surface by a sphere of its radius, less that by the patch's cube, over what the tip
/// itself lacks; by the distance along the needle.
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
        let edge_m = CUBE_PER_RADIUS * patch_radius_m;
        let at = |n: usize| {
            let z_m = n as f64 * step_m;
            (integral_of_sphere(radius_m, nu, z_m) - integral_of_cube(edge_m, radius_m, nu, z_m)) / within
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

/// Returns the integral, along the needle's surface from the middle on, of how an evenly loaded sphere of its radius
/// moves an endless medium; over `1 / (16 pi G (1 - nu))`.
fn integral_of_sphere(radius_m: f64, nu: f64, z_m: f64) -> f64 {
    let part = z_m / z_m.hypot(radius_m);
    (4.0 - 4.0 * nu) * (z_m / radius_m).asinh() - part + (part - part.powi(3)) / 3.0
}

/// Returns the same for an evenly loaded cube with the needle in its middle.
fn integral_of_cube(edge_m: f64, radius_m: f64, nu: f64, z_m: f64) -> f64 {
    let place_m = |n: usize| ((n as f64 + 0.5) / ACROSS as f64 - 0.5) * edge_m;
    // Integral of that by a load at this distance across, over the load's places along the needle.
    let twice = |across_m: f64, z_m: f64| {
        let r = z_m.hypot(across_m);
        (4.0 - 4.0 * nu) * (z_m * (z_m / across_m).asinh() - r) - r
    };
    let each = (0..ACROSS * ACROSS).map(|n| {
        let across_m = (place_m(n % ACROSS) - radius_m).hypot(place_m(n / ACROSS));
        twice(across_m, z_m + 0.5 * edge_m) - twice(across_m, z_m - 0.5 * edge_m)
    });
    each.sum::<f64>() / (ACROSS * ACROSS) as f64 / edge_m
}

#[cfg(test)]
mod tests;
