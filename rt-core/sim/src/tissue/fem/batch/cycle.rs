//! One symmetric V-cycle for eight loads, in passes over single levels.

use std::ops::Range;

use super::kernel::{PlaneOp, TwoPlanes, each, sweep};
use super::level::{BatchLevel, BatchModel};
use super::{LOADS, Node};
use crate::simd::{Simd, vectorised};
use crate::tissue::fem::real::Real;

/// Part of the spectrum, from the top, that the smoother is for.
const SMOOTHED: f64 = 5.0;

/// What one level of a cycle works in.
#[derive(Clone, Debug)]
pub(super) struct Stage<T> {
    pub x: Vec<Node<T>>,
    pub b: Vec<Node<T>>,
    pub d: Vec<Node<T>>,
}

impl<T: Real> Stage<T> {
    pub fn new(level: &BatchLevel<T>) -> Self {
        let zeros = || vec![[[T::ZERO; LOADS]; 3]; level.node_count];
        Stage {
            x: zeros(),
            b: zeros(),
            d: zeros(),
        }
    }
}

/// `keep` and `gain` of the two Chebyshev steps on each side.
fn coefficients(level_top: f64) -> [[f64; 2]; 2] {
    let (top, bottom) = (level_top, level_top / SMOOTHED);
    let (middle, half) = (0.5 * (top + bottom), 0.5 * (top - bottom));
    let rho = half / middle;
    let next = 1.0 / (2.0 * middle / half - rho);
    [[0.0, 1.0 / middle], [next * rho, 2.0 * next / half]]
}

/// `x += d` after `d = keep d + gain (b - A x) / diagonal`.
struct Step<'a, T> {
    b: &'a [Node<T>],
    d: &'a mut [Node<T>],
    inverse_diagonal: &'a [T],
    keep: T,
    gain: T,
}

impl<T: Real> PlaneOp<T> for Step<'_, T> {
    #[inline(always)]
    fn plane(&mut self, at: Range<usize>, forces: &[Node<T>], x: &mut [Node<T>]) {
        let known = self.inverse_diagonal[at.clone()]
            .iter()
            .zip(&self.b[at.clone()])
            .zip(forces);
        for (((&inverse, b), forces), (d, x)) in known.zip(self.d[at].iter_mut().zip(x)) {
            let gain = self.gain * inverse;
            for c in 0..3 {
                let (b, f, d0, x0) = (b[c], forces[c], d[c], x[c]);
                let d1 = each(|n| self.keep * d0[n] + gain * (b[n] - f[n]));
                d[c] = d1;
                x[c] = each(|n| x0[n] + d1[n]);
            }
        }
    }
}

/// `r = b - A x` where nodes are free, zero elsewhere.
struct Residual<'a, T> {
    b: &'a [Node<T>],
    r: &'a mut [Node<T>],
    inverse_diagonal: &'a [T],
}

impl<T: Real> PlaneOp<T> for Residual<'_, T> {
    #[inline(always)]
    fn plane(&mut self, at: Range<usize>, forces: &[Node<T>], _: &mut [Node<T>]) {
        let known = self.inverse_diagonal[at.clone()]
            .iter()
            .zip(&self.b[at.clone()])
            .zip(forces);
        for (((&inverse, b), forces), r) in known.zip(&mut self.r[at]) {
            for c in 0..3 {
                let (b, f) = (b[c], forces[c]);
                r[c] = each(|n| if inverse == T::ZERO { T::ZERO } else { b[n] - f[n] });
            }
        }
    }
}

/// The first step from `x = 0`, which needs no sweep, then the second.
pub(super) fn smooth_down<T: Real>(level: &BatchLevel<T>, stage: &mut Stage<T>, work: &mut TwoPlanes<T>) {
    let [[_, gain], _] = coefficients(level.largest_eigenvalue);
    first_step(level.simd, level, T::of(gain), stage);
    smooth(level, stage, work, 1);
}

/// Step 0 or 1 of the smoother.
pub(super) fn smooth<T: Real>(level: &BatchLevel<T>, stage: &mut Stage<T>, work: &mut TwoPlanes<T>, step: usize) {
    let [keep, gain] = coefficients(level.largest_eigenvalue)[step.min(1)];
    let mut op = Step {
        b: &stage.b,
        d: &mut stage.d,
        inverse_diagonal: &level.inverse_diagonal,
        keep: T::of(keep),
        gain: T::of(gain),
    };
    sweep(level.simd, level, &mut stage.x, work, &mut op);
}

vectorised! {
fn first_step<T>(level: &BatchLevel<T>, gain: T, stage: &mut Stage<T>) {
    let known = level.inverse_diagonal.iter().zip(&stage.b);
    for ((&inverse, b), (d, x)) in known.zip(stage.d.iter_mut().zip(&mut stage.x)) {
        let gain = gain * inverse;
        for c in 0..3 {
            let b = b[c];
            d[c] = each(|n| gain * b[n]);
            x[c] = d[c];
        }
    }
}
}

/// The residual of `fine` becomes the right-hand side of `coarse`. What `d` held is lost.
pub(super) fn restrict<T: Real>(
    level: &BatchLevel<T>,
    fine: &mut Stage<T>,
    coarse: &mut Stage<T>,
    work: &mut TwoPlanes<T>,
) {
    let mut op = Residual {
        b: &fine.b,
        r: &mut fine.d,
        inverse_diagonal: &level.inverse_diagonal,
    };
    sweep(level.simd, level, &mut fine.x, work, &mut op);
    share_out(level.simd, level, &fine.d, &mut coarse.b);
}

vectorised! {
fn share_out<T>(level: &BatchLevel<T>, r: &[Node<T>], b: &mut [Node<T>]) {
    b.fill([[T::ZERO; LOADS]; 3]);
    for (node, r) in r.iter().enumerate() {
        let parents = &level.parents[level.first_parent[node] as usize..level.first_parent[node + 1] as usize];
        let weight = T::of(1.0 / parents.len() as f64);
        for &parent in parents {
            for (b, r) in b[parent as usize].iter_mut().zip(r) {
                let (b0, r) = (*b, *r);
                *b = each(|n| b0[n] + weight * r[n]);
            }
        }
    }
}
}

vectorised! {
/// Adds what the coarser level says to free nodes.
fn prolong<T>(level: &BatchLevel<T>, coarse: &[Node<T>], x: &mut [Node<T>]) {
    for (node, x) in x.iter_mut().enumerate() {
        if level.inverse_diagonal[node] == T::ZERO {
            continue;
        }
        let parents = &level.parents[level.first_parent[node] as usize..level.first_parent[node + 1] as usize];
        let weight = T::of(1.0 / parents.len() as f64);
        let mut sum = [[T::ZERO; LOADS]; 3];
        for &parent in parents {
            for (sum, from) in sum.iter_mut().zip(&coarse[parent as usize]) {
                let (s, f) = (*sum, *from);
                *sum = each(|n| s[n] + f[n]);
            }
        }
        for (x, sum) in x.iter_mut().zip(sum) {
            let x0 = *x;
            *x = each(|n| x0[n] + weight * sum[n]);
        }
    }
}
}

/// The coarsest level, by its inverse.
pub(super) fn solve_coarsest<T: Real>(model: &BatchModel<T>, stage: &mut Stage<T>) {
    let simd = model.levels[0].simd;
    multiply(simd, &model.coarsest, &model.coarsest_nodes, &stage.b, &mut stage.x);
}

vectorised! {
fn multiply<T>(matrix: &[T], nodes: &[u32], b: &[Node<T>], x: &mut [Node<T>]) {
    x.fill([[T::ZERO; LOADS]; 3]);
    let size = 3 * nodes.len();
    for (row, values) in matrix.chunks_exact(size.max(1)).enumerate() {
        let mut sum = [T::ZERO; LOADS];
        for (column, &value) in values.iter().enumerate() {
            let (s, b) = (sum, b[nodes[column / 3] as usize][column % 3]);
            sum = each(|n| s[n] + value * b[n]);
        }
        x[nodes[row / 3] as usize][row % 3] = sum;
    }
}
}
