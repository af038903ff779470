//! Dose on a regular grid, updated seed by seed.

use super::error::DoseError;
use super::kernel::{BLOCK, Block, DoseKernel, Placed};
use super::seed::Seed;
use rayon::prelude::*;

/// Largest number of voxels (2 GiB).
const MAX_VOXELS: usize = 1 << 28;

/// Dose on a grid. Voxel (i, j, k) has its centre at `origin_m + (i, j, k) spacing_m`; x runs
/// fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct DoseGrid {
    origin_m: [f64; 3],
    spacing_m: [f64; 3],
    dims: [usize; 3],
    dose_gy: Vec<f64>,
}

impl DoseGrid {
    /// Creates a grid without dose; returns an error for voxels of zero size or for too many of
    /// them.
    pub fn new(origin_m: [f64; 3], spacing_m: [f64; 3], dims: [usize; 3]) -> Result<Self, DoseError> {
        let voxels = dims.iter().try_fold(1_usize, |n, &d| n.checked_mul(d));
        if !origin_m.iter().chain(&spacing_m).all(|v| v.is_finite()) || spacing_m.iter().any(|&h| h <= 0.0) {
            return Err(DoseError::Grid(
                "the voxels of a dose grid need a side above 0".to_owned(),
            ));
        }
        match voxels {
            Some(voxels @ 1..=MAX_VOXELS) => Ok(Self {
                origin_m,
                spacing_m,
                dims,
                dose_gy: vec![0.0; voxels],
            }),
            _ => Err(DoseError::Grid(format!(
                "a dose grid of {} x {} x {} voxels; allowed are 1 to {MAX_VOXELS} in all: choose larger voxels",
                dims[0], dims[1], dims[2]
            ))),
        }
    }

    /// Creates a grid with a dose from elsewhere, x fastest; returns an error as [`DoseGrid::new`],
    /// and for another number of voxels.
    pub fn of(origin_m: [f64; 3], spacing_m: [f64; 3], dims: [usize; 3], dose_gy: Vec<f64>) -> Result<Self, DoseError> {
        let empty = Self::new(origin_m, spacing_m, dims)?;
        if dose_gy.len() != empty.dose_gy.len() {
            return Err(DoseError::Grid(format!(
                "{} doses for {} voxels",
                dose_gy.len(),
                empty.dose_gy.len()
            )));
        }
        Ok(Self { dose_gy, ..empty })
    }

    /// Creates a grid of cubes that covers a box.
    pub fn covering(low_m: [f64; 3], high_m: [f64; 3], spacing_m: f64) -> Result<Self, DoseError> {
        let dims = [0, 1, 2].map(|a| ((high_m[a] - low_m[a]) / spacing_m - 1e-9).ceil().max(0.0) as usize + 1);
        Self::new(low_m, [spacing_m; 3], dims)
    }

    /// Returns the number of voxels along x, y, z.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Returns the sides of a voxel, in m.
    pub fn spacing_m(&self) -> [f64; 3] {
        self.spacing_m
    }

    /// Returns the dose voxel by voxel, x fastest.
    pub fn dose_gy(&self) -> &[f64] {
        &self.dose_gy
    }

    /// Sets each voxel to a given field (Gy), for example that of another program.
    pub fn fill(&mut self, field_gy: impl Fn([f64; 3]) -> f64 + Sync) {
        let (origin, spacing, dims) = (self.origin_m, self.spacing_m, self.dims);
        self.dose_gy
            .par_chunks_mut(dims[0])
            .enumerate()
            .for_each(|(row, doses)| {
                for (i, dose) in doses.iter_mut().enumerate() {
                    let at = [i, row % dims[1], row / dims[1]];
                    *dose = field_gy([0, 1, 2].map(|a| origin[a] + at[a] as f64 * spacing[a]));
                }
            });
    }

    /// Returns the centre of a voxel, in m.
    pub fn centre_m(&self, [i, j, k]: [usize; 3]) -> [f64; 3] {
        let at = [i as f64, j as f64, k as f64];
        [0, 1, 2].map(|a| self.origin_m[a] + at[a] * self.spacing_m[a])
    }

    /// Returns whether a place lies in a voxel.
    pub fn has(&self, point_m: [f64; 3]) -> bool {
        (0..3).all(|a| {
            let at = (point_m[a] - self.origin_m[a]) / self.spacing_m[a];
            // A part in a million of a voxel is rounding.
            (-0.500_001..=self.dims[a] as f64 - 0.499_999).contains(&at)
        })
    }

    /// Adds the dose of seeds.
    pub fn add(&mut self, kernel: &DoseKernel, seeds: &[Seed]) {
        self.change(kernel, seeds, 1.0, &|_| ());
    }

    /// Like [`DoseGrid::add`]; calls `done` with the number of voxels done since, from any thread.
    pub fn add_reporting(&mut self, kernel: &DoseKernel, seeds: &[Seed], done: &(dyn Fn(u64) + Sync)) {
        self.change(kernel, seeds, 1.0, done);
    }

    /// Undoes [`DoseGrid::add`] to the last bit.
    pub fn remove(&mut self, kernel: &DoseKernel, seeds: &[Seed]) {
        self.change(kernel, seeds, -1.0, &|_| ());
    }

    fn change(&mut self, kernel: &DoseKernel, seeds: &[Seed], sign: f64, done: &(dyn Fn(u64) + Sync)) {
        // Single precision is fine enough from the middle of the grid.
        let anchor_m = self.centre_m(self.dims.map(|d| d / 2));
        let placed: Vec<Placed> = seeds.iter().map(|s| DoseKernel::place(s, anchor_m)).collect();
        let from_anchor = |a: usize| -> Vec<f32> {
            let at = |i| self.origin_m[a] + i as f64 * self.spacing_m[a] - anchor_m[a];
            (0..self.dims[a]).map(|i| at(i) as f32).collect()
        };
        let axes = [from_anchor(0), from_anchor(1), from_anchor(2)];
        let [nx, ny, _] = self.dims;
        // Several blocks to a task, whole rows or not.
        let task = BLOCK * 16;
        self.dose_gy.par_chunks_mut(task).enumerate().for_each(|(t, doses)| {
            for (b, dose) in doses.chunks_mut(BLOCK).enumerate() {
                let first = t * task + b * BLOCK;
                let mut at = [first % nx, first / nx % ny, first / nx / ny];
                let mut block = Block::ORIGIN;
                for i in 0..BLOCK {
                    block.x_m[i] = axes[0][at[0]];
                    block.y_m[i] = axes[1][at[1]];
                    block.z_m[i] = axes[2][at[2]];
                    if i + 1 < dose.len() {
                        at = next(at, nx, ny);
                    }
                }
                kernel.add(&placed, &block, sign, dose);
            }
            done(doses.len() as u64);
        });
    }

    /// Interpolates between the centres of voxels by cubics (Lagrange, four along each axis);
    /// outside the outermost centres holds their dose.
    ///
    /// Linear interpolation would cut the peaks: 0.2 % of a volume at voxels of 1 mm. Next to a
    /// peak that the grid cannot resolve a cubic overshoots, so the dose stays near those of the
    /// eight voxels around. It exceeds them by at most an eighth of the range of all values read,
    /// as a parabola may, and falls below the lowest by at most a tenth of it.
    pub fn at_gy(&self, point_m: [f64; 3]) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|a| Taps::new((point_m[a] - self.origin_m[a]) / self.spacing_m[a], self.dims[a]));
        let [nx, ny, _] = self.dims;
        let row = |k: usize, j: usize| {
            let first = ((z.first + k) * ny + y.first + j) * nx + x.first;
            &self.dose_gy[first..first + x.count]
        };
        let (mut sum, mut near) = (0.0, Range::NONE);
        for k in 0..z.count {
            let mut plane = 0.0;
            for j in 0..y.count {
                let row = row(k, j);
                plane += y.weights[j] * row.iter().zip(x.weights).map(|(d, w)| d * w).sum::<f64>();
                if z.is_next(k) && y.is_next(j) {
                    let next = &row[x.before..(x.before + 2).min(x.count)];
                    next.iter().for_each(|&d| near.take(d));
                }
            }
            sum += z.weights[k] * plane;
        }
        if (near.low..=near.high).contains(&sum) {
            return sum;
        }
        let mut all = Range::NONE;
        for (k, j) in (0..z.count).flat_map(|k| (0..y.count).map(move |j| (k, j))) {
            row(k, j).iter().for_each(|&d| all.take(d));
        }
        let swing = (all.high - all.low) / 8.0;
        sum.min(near.high + swing)
            .max(near.low - swing.min(0.1 * near.low.abs()))
    }
}

/// Lowest and highest of some doses.
struct Range {
    low: f64,
    high: f64,
}

impl Range {
    const NONE: Self = Self {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
    };

    fn take(&mut self, dose: f64) {
        self.low = dose.min(self.low);
        self.high = dose.max(self.high);
    }
}

/// Voxels along one axis from which a place is interpolated.
struct Taps {
    first: usize,
    count: usize,
    weights: [f64; 4],
    /// Index of the last voxel before the place.
    before: usize,
}

impl Taps {
    fn new(at: f64, voxels: usize) -> Self {
        let at = at.clamp(0.0, (voxels - 1) as f64);
        let low = (at as usize).min(voxels.saturating_sub(2));
        if voxels < 4 {
            let share = at - low as f64;
            return Self {
                first: low,
                count: voxels.min(2),
                weights: [1.0 - share, share, 0.0, 0.0],
                before: 0,
            };
        }
        let first = low.saturating_sub(1).min(voxels - 4);
        let u = at - first as f64;
        let (a, b, c, d) = (u, u - 1.0, u - 2.0, u - 3.0);
        Self {
            first,
            count: 4,
            weights: [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0],
            before: low - first,
        }
    }

    fn is_next(&self, tap: usize) -> bool {
        tap == self.before || tap == self.before + 1
    }
}

fn next([i, j, k]: [usize; 3], nx: usize, ny: usize) -> [usize; 3] {
    if i + 1 < nx {
        [i + 1, j, k]
    } else if j + 1 < ny {
        [0, j + 1, k]
    } else {
        [0, 0, k + 1]
    }
}
