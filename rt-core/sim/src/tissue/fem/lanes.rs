//! Arithmetic of lines in whole lanes.
//!
//! Each loop reads all of its lanes before it writes any, so that the compiler need not prove that lines do not
//! overlap.

use super::real::Real;

/// Length of which stretches of lines are multiples, so that loops over them have no remainder.
pub(super) const LANES: usize = 16;

pub(super) type Lane<T> = [T; LANES];

#[inline(always)]
pub(super) fn lanes<T>(line: &[T]) -> &[Lane<T>] {
    line.as_chunks().0
}

#[inline(always)]
pub(super) fn lanes_mut<T>(line: &mut [T]) -> &mut [Lane<T>] {
    line.as_chunks_mut().0
}

/// Returns a lane from its entries.
#[inline(always)]
pub(super) fn each<T: Real>(f: impl Fn(usize) -> T) -> Lane<T> {
    let mut lane = [T::ZERO; LANES];
    for (n, value) in lane.iter_mut().enumerate() {
        *value = f(n);
    }
    lane
}

/// Computes `y += a x`, lane by lane.
#[inline(always)]
pub(super) fn add_products<T: Real>(a: &[T], x: &[T], y: &mut [T]) {
    for ((y, x), a) in lanes_mut(y).iter_mut().zip(lanes(x)).zip(lanes(a)) {
        let (y0, x, a) = (*y, *x, *a);
        *y = each(|n| y0[n] + a[n] * x[n]);
    }
}

/// Computes `y = f(x, y)`.
#[inline(always)]
pub(super) fn update<T: Real>(x: &[T], y: &mut [T], f: impl Fn(T, T) -> T) {
    for (y, x) in lanes_mut(y).iter_mut().zip(lanes(x)) {
        let (y0, x) = (*y, *x);
        *y = each(|n| f(x[n], y0[n]));
    }
}

/// Computes `y = f(x)` where `inverse` is not zero, zero elsewhere.
#[inline(always)]
pub(super) fn where_free<T: Real>(inverse: &[T], x: &[T], y: &mut [T], f: impl Fn(T) -> T) {
    for ((y, x), inverse) in lanes_mut(y).iter_mut().zip(lanes(x)).zip(lanes(inverse)) {
        let (x, inverse) = (*x, *inverse);
        *y = each(|n| if inverse[n] == T::ZERO { T::ZERO } else { f(x[n]) });
    }
}

/// Computes `b - x` where `inverse` is not zero, zero elsewhere.
#[inline(always)]
pub(super) fn difference_where_free<T: Real>(inverse: &[T], b: &[T], x: &[T], y: &mut [T]) {
    let lines = lanes_mut(y).iter_mut().zip(lanes(b)).zip(lanes(x)).zip(lanes(inverse));
    for (((y, b), x), inverse) in lines {
        let (b, x, inverse) = (*b, *x, *inverse);
        *y = each(|n| if inverse[n] == T::ZERO { T::ZERO } else { b[n] - x[n] });
    }
}

/// Computes `d = keep d + gain inverse (b - forces)`, then `x += d`.
#[inline(always)]
pub(super) fn chebyshev_step<T: Real>(
    [keep, gain]: [T; 2],
    inverse: &[T],
    b: &[T],
    forces: &[T],
    d: &mut [T],
    x: &mut [T],
) {
    let known = lanes(inverse).iter().zip(lanes(b)).zip(lanes(forces));
    for (((inverse, b), forces), (d, x)) in known.zip(lanes_mut(d).iter_mut().zip(lanes_mut(x))) {
        let (inverse, b, forces, d0, x0) = (*inverse, *b, *forces, *d, *x);
        let d1 = each(|n| keep * d0[n] + gain * inverse[n] * (b[n] - forces[n]));
        *d = d1;
        *x = each(|n| x0[n] + d1[n]);
    }
}

/// Computes `d = x = gain inverse b`: the first step of `chebyshev_step` from `x = 0`.
#[inline(always)]
pub(super) fn first_chebyshev<T: Real>(gain: T, inverse: &[T], b: &[T], d: &mut [T], x: &mut [T]) {
    let known = lanes(inverse).iter().zip(lanes(b));
    for ((inverse, b), (d, x)) in known.zip(lanes_mut(d).iter_mut().zip(lanes_mut(x))) {
        let (inverse, b) = (*inverse, *b);
        *d = each(|n| gain * inverse[n] * b[n]);
        *x = *d;
    }
}

/// Returns the dot product: as many sums side by side as there are lanes, always in the same order, then in f64.
#[inline(always)]
pub(super) fn dot<T: Real>(a: &[T], b: &[T]) -> f64 {
    let mut sums = [T::ZERO; LANES];
    for (a, b) in lanes(a).iter().zip(lanes(b)) {
        let (a, b, before) = (*a, *b, sums);
        sums = each(|n| before[n] + a[n] * b[n]);
    }
    sums.iter().map(|s| s.to_f64()).sum()
}
