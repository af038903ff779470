//! The grid of beams and depths, and the distances between the scatterers that give speckle.

use super::{Plane, View};

/// Number of depths between two points at which the material point is found: displacements vary
/// over millimetres.
pub const MAP_CELL: u32 = 8;

/// Number of beams, depths and slices across the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    pub lines: u32,
    pub samples: u32,
    pub slices: u32,
    /// Distance between scatterers along x, y, z, m. Beams go across the probe, so along z they may
    /// lie farther apart. A distance below that between samples would let speckle change abruptly
    /// instead of slowly.
    pub scatterers_m: [f64; 3],
}

impl Grid {
    pub fn of(plane: &Plane) -> Self {
        const SAMPLE_M: f64 = 0.18e-3;
        let samples = (plane.depth_m / SAMPLE_M).ceil().clamp(64.0, 1024.0) as u32 + 1;
        match plane.view {
            View::Transverse => Self {
                lines: 320,
                samples,
                slices: 5,
                scatterers_m: [0.25e-3, 0.25e-3, 0.9e-3],
            },
            // Here the slices are stacked across the probe, where scatterers are dense.
            View::Sagittal => Self {
                lines: 192,
                samples,
                slices: 11,
                scatterers_m: [0.3e-3, 0.3e-3, 0.35e-3],
            },
        }
    }

    pub fn count(&self) -> usize {
        self.lines as usize * self.samples as usize
    }

    /// Returns the grid of points at which the material point is found, at both ends of the slices.
    pub fn map_cells(&self) -> [u32; 2] {
        [self.lines, self.samples].map(|n| (n - 1) / MAP_CELL + 2)
    }
}

/// Returns the power of each sample's sum of echoes over that of one, beyond the effect of its
/// weights: neighbouring samples share scatterers.
pub fn powers(plane: &Plane, grid: Grid) -> Vec<f32> {
    let [fine_m, _, along_m] = grid.scatterers_m;
    let (across_m, slices_m) = match plane.view {
        View::Transverse => (fine_m, along_m),
        View::Sagittal => (along_m, fine_m),
    };
    let sample_m = plane.depth_m / f64::from(grid.samples - 1);
    let pulse = sum_of_neighbours(plane.probe.axial_m / sample_m, sample_m / fine_m);
    let at = |sample: u32| {
        let depth_m = f64::from(sample) * sample_m;
        let pitch_m = plane.pitch_m(grid.lines, depth_m);
        let across = sum_of_neighbours(plane.probe.lateral_at_m(depth_m) / pitch_m, pitch_m / across_m);
        // Slices extend two spreads to both sides.
        let per_spread = f64::from(grid.slices - 1) / 4.0;
        let slice_m = plane.probe.thickness_at_m(depth_m) / per_spread;
        (pulse * across * sum_of_neighbours(per_spread, slice_m / slices_m)) as f32
    };
    (0..grid.samples).map(at).collect()
}

/// Sums Gaussian weights with this spread in steps, over scatterers at a distance of which a step
/// is this share.
fn sum_of_neighbours(spread: f64, step: f64) -> f64 {
    let lags = (1..200).map(f64::from).take_while(|lag| lag * step < 2.0);
    1.0 + 2.0
        * lags
            .map(|lag| (-0.25 * (lag / spread).powi(2)).exp() * shared(lag * step))
            .sum::<f64>()
}

/// Returns the correlation of two points, linearly interpolated between scatterers at distance 1
/// and of equal power: the mean over the position of the first one.
fn shared(apart: f64) -> f64 {
    const PLACES: u32 = 16;
    let weights = |at: f64| {
        let after = at.fract();
        let power = after.mul_add(after, (1.0 - after).powi(2)).sqrt();
        (at.floor(), [(1.0 - after) / power, after / power])
    };
    let of_place = |n: u32| {
        let at = (f64::from(n) + 0.5) / f64::from(PLACES);
        let ((_, one), (cell, other)) = (weights(at), weights(at + apart));
        match cell {
            0.0 => one[0] * other[0] + one[1] * other[1],
            1.0 => one[1] * other[0],
            _ => 0.0,
        }
    };
    (0..PLACES).map(of_place).sum::<f64>() / f64::from(PLACES)
}
