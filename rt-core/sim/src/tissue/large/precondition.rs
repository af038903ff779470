//! The inverse of the seven-point Laplacian with its rim held: what a solver's steps are measured with.

use super::energy::Nodes;
use super::grid::{Grid, ROW};
use crate::simd::{Simd, vectorised};

/// Sines along an axis, in which the Laplacian is a number for each.
#[derive(Clone, Debug)]
pub(super) struct Laplacian {
    /// Rows as long as those of the grid.
    sines: Vec<f32>,
    /// By node.
    inverse: Vec<f32>,
}

impl Laplacian {
    pub fn new(grid: &Grid) -> Self {
        let (n, stride) = (grid.side, grid.stride);
        let inner = n - 2;
        let angle = std::f64::consts::PI / (inner + 1) as f64;
        let mut sines = vec![0.0; n * stride];
        for a in 1..=inner {
            for b in 1..=inner {
                let value = (2.0 / (inner + 1) as f64).sqrt() * (angle * (a * b) as f64).sin();
                sines[a * stride + b] = value as f32;
            }
        }
        let of = |k: usize| 2.0 - 2.0 * (angle * k as f64).cos();
        let mut inverse = vec![0.0; grid.len()];
        for place in grid.places().filter(|p| p.iter().all(|&c| c > 0 && c < n - 1)) {
            inverse[grid.at(place)] = (1.0 / place.iter().map(|&c| of(c)).sum::<f64>()) as f32;
        }
        Laplacian { sines, inverse }
    }

    /// In place; `room` is as long as one component.
    pub fn apply(&self, simd: Simd, grid: &Grid, of: &mut Nodes, room: &mut [f32]) {
        for axis in of {
            along_x(simd, grid, &self.sines, axis, room);
            across(simd, grid, &self.sines, [1, 0], room, axis);
            across(simd, grid, &self.sines, [0, 1], axis, room);
            for (value, inverse) in room.iter_mut().zip(&self.inverse) {
                *value *= inverse;
            }
            across(simd, grid, &self.sines, [0, 1], room, axis);
            across(simd, grid, &self.sines, [1, 0], axis, room);
            along_x(simd, grid, &self.sines, room, axis);
        }
    }
}

vectorised! {
fn along_x(grid: &Grid, sines: &[f32], from: &[f32], to: &mut [f32]) {
    let stride = grid.stride;
    for (from, to) in from.chunks_exact(stride).zip(to.chunks_exact_mut(stride)) {
        for at in (0..stride).step_by(ROW) {
            let mut sum = [0.0_f32; ROW];
            for (x, &value) in from.iter().enumerate().take(grid.side - 1).skip(1) {
                let sines: &[f32; ROW] = sines[x * stride + at..][..ROW].try_into().expect("a row");
                for l in 0..ROW {
                    sum[l] += value * sines[l];
                }
            }
            to[at..at + ROW].copy_from_slice(&sum);
        }
    }
}
}

vectorised! {
/// Along y by `[1, 0]`, along z by `[0, 1]`.
fn across(grid: &Grid, sines: &[f32], along: [usize; 2], from: &[f32], to: &mut [f32]) {
    let (n, stride) = (grid.side, grid.stride);
    let step = stride * (along[0] + n * along[1]);
    let other = stride * (along[1] + n * along[0]);
    for line in 0..n {
        for at in (0..stride).step_by(ROW) {
            for out in 0..n {
                let mut sum = [0.0_f32; ROW];
                for inner in 1..n - 1 {
                    let value = sines[out * stride + inner];
                    let from: &[f32; ROW] = from[line * other + inner * step + at..][..ROW].try_into().expect("a row");
                    for l in 0..ROW {
                        sum[l] += value * from[l];
                    }
                }
                to[line * other + out * step + at..][..ROW].copy_from_slice(&sum);
            }
        }
    }
}
}
