//! One symmetric V-cycle for eight loads, in passes over single levels.

use std::ops::Range;

use super::Node;
use super::kernel::{PlaneOp, TwoPlanes, answer, nothing, sweep};
use super::level::{BatchLevel, BatchModel};
use crate::simd::{Vector, in_vectors};
use crate::tissue::fem::chebyshev;
use crate::tissue::fem::real::Real;

/// Work space of one level of a cycle.
#[derive(Clone, Debug)]
pub(super) struct Stage<T> {
    pub x: Vec<Node<T>>,
    pub b: Vec<Node<T>>,
    pub d: Vec<Node<T>>,
}

impl<T: Real> Stage<T> {
    pub fn new(level: &BatchLevel<T>) -> Self {
        let zeros = || vec![nothing(); level.node_count];
        Stage {
            x: zeros(),
            b: zeros(),
            d: zeros(),
        }
    }
}

/// Returns `keep` and `gain` of the two Chebyshev steps on each side.
fn coefficients(top: f64) -> [[f64; 2]; 2] {
    let mut steps = chebyshev::steps(top);
    std::array::from_fn(|_| steps.next().unwrap_or_default())
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
    fn plane<V: Vector<T>>(&mut self, at: Range<usize>, forces: &[Node<T>], springs: &[T], x: &mut [Node<T>]) {
        let keep = V::splat(self.keep);
        let known = self.inverse_diagonal[at.clone()].iter().zip(springs);
        let known = known.zip(self.b[at.clone()].iter().zip(forces));
        for (((&inverse, &spring), (b, forces)), (d, x)) in known.zip(self.d[at].iter_mut().zip(x)) {
            let gain = V::splat(self.gain * inverse);
            for c in 0..3 {
                let x0 = V::load(&x[c]);
                let left = V::load(&b[c]).sub(answer::<T, V>(&forces[c], spring, x0));
                let d1 = keep.mul(V::load(&d[c])).add(gain.mul(left));
                d1.store(&mut d[c]);
                x0.add(d1).store(&mut x[c]);
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
    fn plane<V: Vector<T>>(&mut self, at: Range<usize>, forces: &[Node<T>], springs: &[T], x: &mut [Node<T>]) {
        let known = self.inverse_diagonal[at.clone()].iter().zip(springs);
        let known = known.zip(self.b[at.clone()].iter().zip(forces));
        for (((&inverse, &spring), (b, forces)), (r, x)) in known.zip(self.r[at].iter_mut().zip(x)) {
            if inverse == T::ZERO {
                *r = nothing();
                continue;
            }
            for c in 0..3 {
                let force = answer::<T, V>(&forces[c], spring, V::load(&x[c]));
                V::load(&b[c]).sub(force).store(&mut r[c]);
            }
        }
    }
}

/// Makes the first step from `x = 0`, which needs no sweep, then the second.
pub(super) fn smooth_down<T: Real>(level: &BatchLevel<T>, stage: &mut Stage<T>, work: &mut TwoPlanes<T>) {
    let [[_, gain], _] = coefficients(level.largest_eigenvalue);
    first_step(level.simd, level, T::of(gain), stage);
    smooth(level, stage, work, 1);
}

/// Makes step 0 or 1 of the smoother.
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

in_vectors! {
fn first_step<T: Real, V>(level: &BatchLevel<T>, gain: T, stage: &mut Stage<T>) {
    let known = level.inverse_diagonal.iter().zip(&stage.b);
    for ((&inverse, b), (d, x)) in known.zip(stage.d.iter_mut().zip(&mut stage.x)) {
        let gain = V::splat(gain * inverse);
        for c in 0..3 {
            let step = gain.mul(V::load(&b[c]));
            step.store(&mut d[c]);
            step.store(&mut x[c]);
        }
    }
}
}

/// Restricts the residual of `fine` to the right-hand side of `coarse`. Overwrites `d`.
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

/// Returns the weight of a node for each of so many parents; there are eight at most.
fn weights<T: Real>() -> [T; 9] {
    std::array::from_fn(|count| T::of(1.0 / count.max(1) as f64))
}

in_vectors! {
fn share_out<T: Real, V>(level: &BatchLevel<T>, r: &[Node<T>], b: &mut [Node<T>]) {
    b.fill(nothing());
    let weights = weights();
    for (parents, r) in level.parents().zip(r) {
        let weight = V::splat(weights[parents.len() % weights.len()]);
        for c in 0..3 {
            let share = weight.mul(V::load(&r[c]));
            for &parent in parents {
                let b = &mut b[parent as usize][c];
                V::load(b).add(share).store(b);
            }
        }
    }
}
}

in_vectors! {
/// Adds what the coarser level says to free nodes.
fn prolong<T: Real, V>(level: &BatchLevel<T>, coarse: &[Node<T>], x: &mut [Node<T>]) {
    let weights = weights();
    let nodes = level.parents().zip(&level.inverse_diagonal).zip(x);
    for ((parents, _), x) in nodes.filter(|((_, inverse), _)| **inverse != T::ZERO) {
        let weight = V::splat(weights[parents.len() % weights.len()]);
        for c in 0..3 {
            let mut sum = V::splat(T::ZERO);
            for &parent in parents {
                sum = sum.add(V::load(&coarse[parent as usize][c]));
            }
            V::load(&x[c]).add(weight.mul(sum)).store(&mut x[c]);
        }
    }
}
}

/// Solves the coarsest level by its inverse.
pub(super) fn solve_coarsest<T: Real>(model: &BatchModel<T>, stage: &mut Stage<T>) {
    let simd = model.levels[0].simd;
    multiply(simd, &model.coarsest, &model.coarsest_nodes, &stage.b, &mut stage.x);
}

in_vectors! {
fn multiply<T: Real, V>(matrix: &[T], nodes: &[u32], b: &[Node<T>], x: &mut [Node<T>]) {
    x.fill(nothing());
    let size = 3 * nodes.len();
    for (row, values) in matrix.chunks_exact(size.max(1)).enumerate() {
        let mut sum = V::splat(T::ZERO);
        for (values, &node) in values.as_chunks::<3>().0.iter().zip(nodes) {
            let b = &b[node as usize];
            for c in 0..3 {
                sum = sum.add(V::splat(values[c]).mul(V::load(&b[c])));
            }
        }
        sum.store(&mut x[nodes[row / 3] as usize][row % 3]);
    }
}
}
