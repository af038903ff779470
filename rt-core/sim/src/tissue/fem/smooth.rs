//! Operations on the forces of a sweep: Chebyshev smoothing, residuals, dot products.

use std::ops::Range;

use super::chebyshev;
use super::lanes::{chebyshev_step, difference_where_free, dot, first_chebyshev, where_free};
use super::level::Level;
use super::real::Real;
use super::sweep::{Field, LineOp, Planes, sweep};
use crate::simd::{Simd, vectorised};

/// `x += d` after `d = keep d + gain (b - A x) / diagonal`: one step of a Chebyshev iteration.
struct Step<'a, T> {
    b: &'a Field<T>,
    d: &'a mut Field<T>,
    inverse_diagonal: &'a [T],
    keep: T,
    gain: T,
}

impl<T: Real> LineOp<T> for Step<'_, T> {
    #[inline(always)]
    fn line(&mut self, at: Range<usize>, forces: [&[T]; 3], x: [&mut [T]; 3]) {
        let inverse = &self.inverse_diagonal[at.clone()];
        for (c, x) in x.into_iter().enumerate() {
            let (d, b) = (&mut self.d[c][at.clone()], &self.b[c][at.clone()]);
            chebyshev_step([self.keep, self.gain], inverse, b, forces[c], d, x);
        }
    }
}

/// Makes `steps` steps of a Chebyshev iteration for `A x = b`, which damps the upper part of the spectrum evenly.
pub(super) fn smooth<T: Real>(
    level: &Level<T>,
    inverse_diagonal: &[T],
    [x, b, d]: [&mut Field<T>; 3],
    work: &mut Planes<T>,
    steps: u32,
    from_zero: bool,
) {
    for (n, [keep, gain]) in (0..steps).zip(chebyshev::steps(level.largest_eigenvalue)) {
        if n == 0 && from_zero {
            first_step(level.simd, level, inverse_diagonal, x, b, d, T::of(gain));
        } else {
            let mut op = Step {
                b,
                d,
                inverse_diagonal,
                keep: T::of(keep),
                gain: T::of(gain),
            };
            sweep(level, x, work, 0..level.grid.nodes[2], &mut op);
        }
    }
}

vectorised! {
/// Makes the first step from `x = 0`, which needs no sweep.
fn first_step<T>(
    level: &Level<T>,
    inverse_diagonal: &[T],
    x: &mut Field<T>,
    b: &Field<T>,
    d: &mut Field<T>,
    gain: T,
) {
    for at in level.grid.node_spans() {
        let inverse = &inverse_diagonal[at.clone()];
        for c in 0..3 {
            let (x, d, b) = (&mut x[c][at.clone()], &mut d[c][at.clone()], &b[c][at.clone()]);
            first_chebyshev(gain, inverse, b, d, x);
        }
    }
}
}

/// `r = b - A x` where nodes are free, zero elsewhere.
pub(super) struct Residual<'a, T> {
    pub b: &'a Field<T>,
    pub r: &'a mut Field<T>,
    pub inverse_diagonal: &'a [T],
}

impl<T: Real> LineOp<T> for Residual<'_, T> {
    #[inline(always)]
    fn line(&mut self, at: Range<usize>, forces: [&[T]; 3], _: [&mut [T]; 3]) {
        let inverse = &self.inverse_diagonal[at.clone()];
        for (c, forces) in forces.into_iter().enumerate() {
            let b = &self.b[c][at.clone()];
            difference_where_free(inverse, b, forces, &mut self.r[c][at.clone()]);
        }
    }
}

/// `q = A p` where nodes are free, zero elsewhere; `p . q`.
pub(super) struct Product<'a, T> {
    pub q: &'a mut Field<T>,
    pub inverse_diagonal: &'a [T],
    pub dot: f64,
}

impl<T: Real> LineOp<T> for Product<'_, T> {
    #[inline(always)]
    fn line(&mut self, at: Range<usize>, forces: [&[T]; 3], p: [&mut [T]; 3]) {
        let inverse = &self.inverse_diagonal[at.clone()];
        for (c, p) in p.into_iter().enumerate() {
            let q = &mut self.q[c][at.clone()];
            where_free(inverse, forces[c], q, |force| force);
            self.dot += dot(q, p);
        }
    }
}
