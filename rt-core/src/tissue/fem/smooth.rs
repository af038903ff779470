//! What is done with the forces of a sweep: Chebyshev smoothing, residuals, dot products.

use std::ops::Range;

use super::level::Level;
use super::real::Real;
use super::sweep::{Field, LineOp, Planes, sweep};

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
            step_line(d, b, forces[c], inverse, [self.keep, self.gain], x);
        }
    }
}

#[inline(always)]
fn step_line<T: Real>(d: &mut [T], b: &[T], forces: &[T], inverse: &[T], [keep, gain]: [T; 2], x: &mut [T]) {
    let n = x.len();
    let (d, b, forces, inverse) = (&mut d[..n], &b[..n], &forces[..n], &inverse[..n]);
    for i in 0..n {
        d[i] = keep * d[i] + gain * inverse[i] * (b[i] - forces[i]);
        x[i] += d[i];
    }
}

/// Part of the spectrum, from the top, that the smoother is for.
const SMOOTHED: f64 = 5.0;

/// `steps` of a Chebyshev iteration for `A x = b`, which damps the upper part of the spectrum evenly.
///
/// The same polynomial before and after the coarse correction keeps the cycle symmetric, as conjugate gradients need.
pub(super) fn smooth<T: Real>(
    level: &Level<T>,
    inverse_diagonal: &[T],
    [x, b, d]: [&mut Field<T>; 3],
    work: &mut Planes<T>,
    steps: u32,
    from_zero: bool,
) {
    let (top, bottom) = (level.largest_eigenvalue, level.largest_eigenvalue / SMOOTHED);
    let (middle, half) = (0.5 * (top + bottom), 0.5 * (top - bottom));
    let mut rho = half / middle;
    let (mut keep, mut gain) = (0.0, 1.0 / middle);
    for n in 0..steps {
        if n == 0 && from_zero {
            first_step(level, inverse_diagonal, x, b, d, T::of(gain));
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
        let next = 1.0 / (2.0 * middle / half - rho);
        (keep, gain) = (next * rho, 2.0 * next / half);
        rho = next;
    }
}

/// The first step from `x = 0`, which needs no sweep.
fn first_step<T: Real>(
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
            let n = inverse.len();
            let (x, d, b) = (&mut x[..n], &mut d[..n], &b[..n]);
            for i in 0..n {
                d[i] = gain * inverse[i] * b[i];
                x[i] = d[i];
            }
        }
    }
}

/// `r = b - A x` where nodes are free, zero elsewhere; `b` is zero where there is none.
pub(super) struct Residual<'a, T> {
    pub b: Option<&'a Field<T>>,
    pub r: &'a mut Field<T>,
    pub inverse_diagonal: &'a [T],
    pub square: f64,
}

impl<T: Real> LineOp<T> for Residual<'_, T> {
    #[inline(always)]
    fn line(&mut self, at: Range<usize>, forces: [&[T]; 3], _: [&mut [T]; 3]) {
        let inverse = &self.inverse_diagonal[at.clone()];
        let n = inverse.len();
        for c in 0..3 {
            let (r, force) = (&mut self.r[c][at.clone()][..n], &forces[c][..n]);
            match self.b {
                Some(b) => {
                    let b = &b[c][at.clone()][..n];
                    for i in 0..n {
                        r[i] = if inverse[i] == T::ZERO {
                            T::ZERO
                        } else {
                            b[i] - force[i]
                        };
                    }
                }
                None => {
                    for i in 0..n {
                        r[i] = if inverse[i] == T::ZERO { T::ZERO } else { -force[i] };
                    }
                }
            }
            self.square += dot_line(r, r);
        }
    }
}

/// `q = A p` where nodes are free, and `p . q`.
pub(super) struct Product<'a, T> {
    pub q: &'a mut Field<T>,
    pub inverse_diagonal: &'a [T],
    pub dot: f64,
}

impl<T: Real> LineOp<T> for Product<'_, T> {
    #[inline(always)]
    fn line(&mut self, at: Range<usize>, forces: [&[T]; 3], p: [&mut [T]; 3]) {
        let inverse = &self.inverse_diagonal[at.clone()];
        let n = inverse.len();
        for (c, p) in p.into_iter().enumerate() {
            let (q, force) = (&mut self.q[c][at.clone()][..n], &forces[c][..n]);
            for i in 0..n {
                q[i] = if inverse[i] == T::ZERO { T::ZERO } else { force[i] };
            }
            self.dot += dot_line(q, p);
        }
    }
}

/// Dot product of a line: sixteen sums side by side, always in the same order, then in f64.
#[inline(always)]
pub(super) fn dot_line<T: Real>(a: &[T], b: &[T]) -> f64 {
    const WIDTH: usize = 16;
    let mut sums = [T::ZERO; WIDTH];
    let (a, b) = (a.chunks_exact(WIDTH), b.chunks_exact(WIDTH));
    let rest = a.remainder().iter().zip(b.remainder());
    let rest: f64 = rest.map(|(&a, &b)| (a * b).to_f64()).sum();
    for (a, b) in a.zip(b) {
        for lane in 0..WIDTH {
            sums[lane] += a[lane] * b[lane];
        }
    }
    rest + sums.iter().map(|s| s.to_f64()).sum::<f64>()
}
