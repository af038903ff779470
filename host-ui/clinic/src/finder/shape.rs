//! Model of a seed in a CT: a line of its length, blurred, summed in each voxel.

use super::components::index;
use nalgebra::Vector3;
use std::f64::consts::SQRT_2;

/// Points along a seed.
const POINTS: usize = 5;

/// Seed in the frame of the voxels (m along each axis, from the centre of the first voxel).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Centre.
    pub middle_m: Vector3<f64>,
    /// Unit vector.
    pub axis: Vector3<f64>,
    /// Signal, as a share of that of a typical seed.
    pub amount: f64,
}

/// Parameters common to all seeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Length, in m.
    pub length_m: f64,
    /// Diameter, in m.
    pub diameter_m: f64,
    /// Standard deviation of the scanner's blur, in m.
    pub blur_m: f64,
    /// Sum of the values above the tissue.
    pub signal: f64,
}

/// Voxels of a component, within a box.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    low: [usize; 3],
    size: [usize; 3],
    spacing_m: [f64; 3],
    /// Indices along each axis in the box, of every voxel.
    at: Vec<[usize; 3]>,
}

impl Patch {
    /// Creates a patch of voxels, by their indices in the volume.
    pub fn of(dims: [usize; 3], spacing_m: [f64; 3], voxels: &[usize]) -> Self {
        let places: Vec<[usize; 3]> = voxels.iter().map(|n| index(dims, *n)).collect();
        let of_axis = |a: usize| places.iter().map(move |p| p[a]);
        let low = [0, 1, 2].map(|a| of_axis(a).min().unwrap_or(0));
        let high = [0, 1, 2].map(|a| of_axis(a).max().unwrap_or(0));
        Self {
            low,
            size: [0, 1, 2].map(|a| high[a] + 1 - low[a]),
            spacing_m,
            at: places.iter().map(|p| [0, 1, 2].map(|a| p[a] - low[a])).collect(),
        }
    }

    /// Returns the indices in the volume of all voxels of the box, with `room` voxels more on every
    /// side.
    pub fn with_room(&self, dims: [usize; 3], room: usize) -> Vec<usize> {
        let range = |a: usize| self.low[a].saturating_sub(room)..(self.low[a] + self.size[a] + room).min(dims[a]);
        let [nx, ny, _] = dims;
        let mut all = Vec::new();
        for k in range(2) {
            for j in range(1) {
                all.extend(range(0).map(|i| (k * ny + j) * nx + i));
            }
        }
        all
    }

    /// Adds the contribution of a seed to each voxel, `share` times.
    pub fn add(&self, seed: &Line, look: &Look, share: f64, to: &mut [f64]) {
        // A disc of radius r has the standard deviation r/2 along each of its axes.
        let blur_m = look.blur_m.hypot(look.diameter_m / 4.0);
        let height = share * seed.amount * look.signal / POINTS as f64;
        for point in 0..POINTS {
            let along_m = ((point as f64 + 0.5) / POINTS as f64 - 0.5) * look.length_m;
            let place = seed.middle_m + seed.axis * along_m;
            let parts = [0, 1, 2].map(|a| self.parts(a, place[a], blur_m));
            for (value, at) in to.iter_mut().zip(&self.at) {
                *value += height * parts[0][at[0]] * parts[1][at[1]] * parts[2][at[2]];
            }
        }
    }

    /// Returns the share of a blurred point between the faces of each voxel along an axis.
    fn parts(&self, axis: usize, place_m: f64, blur_m: f64) -> Vec<f64> {
        let side = self.spacing_m[axis];
        let below = |face: usize| {
            let face_m = ((self.low[axis] + face) as f64 - 0.5) * side;
            0.5 * (1.0 + erf((face_m - place_m) / (blur_m * SQRT_2)))
        };
        let faces: Vec<f64> = (0..=self.size[axis]).map(below).collect();
        faces.windows(2).map(|pair| pair[1] - pair[0]).collect()
    }
}

/// Computes the error function, to 1.5e-7 (Abramowitz and Stegun, 7.1.26).
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let series =
        t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    (1.0 - series * (-x * x).exp()).copysign(x)
}
