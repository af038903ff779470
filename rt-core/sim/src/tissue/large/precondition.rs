//! Inverse of the seven-point Laplacian with its rim held: the metric of the solver's steps.

use super::SIDE;
use super::energy::Nodes;
use super::grid::{Grid, ROW};
use crate::simd::{Simd, Vector, in_vectors, vectorised};

/// Nodes along an edge without the rim: an odd number, with one in the middle.
const INNER: usize = SIDE - 2;
const HALF: usize = INNER / 2;

/// Sines along an axis, in which the Laplacian is a number for each.
#[derive(Clone, Debug)]
pub(super) struct Laplacian {
    /// Halves of each sine at the inner nodes up to the middle: beyond it they are those, or their negatives.
    halves: [[f32; HALF + 1]; INNER],
    /// Sines by node and number, in rows as long as those of the grid.
    sines: Vec<f32>,
    /// Inverse by node.
    inverse: Vec<f32>,
}

impl Laplacian {
    pub fn new(grid: &Grid) -> Self {
        let stride = grid.stride;
        let angle = std::f64::consts::PI / (INNER + 1) as f64;
        let sine = |a: usize, b: usize| ((2.0 / (INNER + 1) as f64).sqrt() * (angle * (a * b) as f64).sin()) as f32;
        let mut sines = vec![0.0; SIDE * stride];
        for a in 1..=INNER {
            for b in 1..=INNER {
                sines[a * stride + b] = sine(a, b);
            }
        }
        let of = |k: usize| 2.0 - 2.0 * (angle * k as f64).cos();
        let mut inverse = vec![0.0; grid.len()];
        for place in grid.places().filter(|p| p.iter().all(|&c| c > 0 && c < SIDE - 1)) {
            inverse[grid.at(place)] = (1.0 / place.iter().map(|&c| of(c)).sum::<f64>()) as f32;
        }
        Laplacian {
            halves: std::array::from_fn(|k| std::array::from_fn(|i| sine(k + 1, i + 1))),
            sines,
            inverse,
        }
    }

    /// Applies it in place; the rim keeps its values.
    pub fn apply(&self, simd: Simd, grid: &Grid, of: &mut Nodes) {
        for axis in of {
            along_x(simd, grid, &self.sines, axis);
            along_y(simd, grid, &self.halves, axis);
            there_and_back_along_z(simd, grid, &self.halves, &self.inverse, axis);
            along_y(simd, grid, &self.halves, axis);
            along_x(simd, grid, &self.sines, axis);
        }
    }
}

vectorised! {
fn along_x(grid: &Grid, sines: &[f32], values: &mut [f32]) {
    let stride = grid.stride;
    for (y, z) in (0..INNER * INNER).map(|line| (1 + line % INNER, 1 + line / INNER)) {
        let at = grid.at([0, y, z]);
        let row = &mut values[at..at + stride];
        let from: [f32; INNER] = row[1..=INNER].try_into().expect("a row");
        for at in (0..stride).step_by(ROW) {
            let mut sum = [0.0_f32; ROW];
            for (x, value) in from.iter().enumerate() {
                let sines: &[f32; ROW] = sines[(x + 1) * stride + at..][..ROW].try_into().expect("a row");
                for l in 0..ROW {
                    sum[l] += value * sines[l];
                }
            }
            row[at..at + ROW].copy_from_slice(&sum);
        }
    }
}
}

in_vectors! {
fn along_y<V: Vector<f32>>(grid: &Grid, halves: &[[f32; HALF + 1]; INNER], values: &mut [f32]) {
    for z in 1..=INNER {
        for x in (0..grid.stride).step_by(ROW) {
            let at = grid.at([x, 1, z]);
            let line = line::<V>(values, at, grid.stride);
            put(values, at, grid.stride, &in_sines(&line, halves));
        }
    }
}
}

in_vectors! {
fn there_and_back_along_z<V: Vector<f32>>(grid: &Grid, halves: &[[f32; HALF + 1]; INNER], inverse: &[f32], values: &mut [f32]) {
    let step = grid.stride * grid.side;
    for y in 1..=INNER {
        for x in (0..grid.stride).step_by(ROW) {
            let at = grid.at([x, y, 1]);
            let mut of_sines = in_sines(&line::<V>(values, at, step), halves);
            for (value, inverse) in of_sines.iter_mut().zip(line::<V>(inverse, at, step)) {
                *value = value.mul(inverse);
            }
            put(values, at, step, &in_sines(&of_sines, halves));
        }
    }
}
}

#[inline(always)]
fn line<V: Vector<f32>>(values: &[f32], at: usize, step: usize) -> [V; INNER] {
    let mut line = [V::splat(0.0); INNER];
    for (n, to) in line.iter_mut().enumerate() {
        *to = V::load(values[at + n * step..][..ROW].try_into().expect("a row"));
    }
    line
}

#[inline(always)]
fn put<V: Vector<f32>>(values: &mut [f32], at: usize, step: usize, line: &[V; INNER]) {
    for (n, value) in line.iter().enumerate() {
        value.store((&mut values[at + n * step..][..ROW]).try_into().expect("a row"));
    }
}

/// Sines alternate between symmetric and antisymmetric about the middle, so sums and differences of both sides suffice.
#[inline(always)]
fn in_sines<V: Vector<f32>>(line: &[V; INNER], halves: &[[f32; HALF + 1]; INNER]) -> [V; INNER] {
    let (mut together, mut apart) = ([line[HALF]; HALF + 1], [line[HALF]; HALF]);
    for n in 0..HALF {
        together[n] = line[n].add(line[INNER - 1 - n]);
        apart[n] = line[n].sub(line[INNER - 1 - n]);
    }
    let mut sums = [V::splat(0.0); INNER];
    for (k, (sum, half)) in sums.iter_mut().zip(halves).enumerate() {
        let both = if k % 2 == 0 { &together[..] } else { &apart[..] };
        for (value, sine) in both.iter().zip(half) {
            *sum = sum.add(value.mul(V::splat(*sine)));
        }
    }
    sums
}
