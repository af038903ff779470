//! A square matrix in rows of whole lanes, for loops without a remainder.

use crate::simd::LANES;
use serde::{Deserialize, Serialize};

/// Rows with zeros past their end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rows {
    size: usize,
    stride: usize,
    values: Vec<f64>,
}

impl Rows {
    /// Makes a square matrix of that size, entry by entry.
    pub fn new(size: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let stride = size.next_multiple_of(LANES);
        let at = |n: usize| {
            if n % stride < size {
                entry(n / stride, n % stride)
            } else {
                0.0
            }
        };
        Rows {
            size,
            stride,
            values: (0..size * stride).map(at).collect(),
        }
    }

    /// Makes a matrix of zeros, with room for matrices up to that size.
    pub(super) fn with_room(size: usize) -> Self {
        let mut rows = Rows::new(size, |_, _| 1.0);
        rows.values.fill(0.0);
        rows
    }

    /// Becomes a matrix of zeros of that size, for which there is room; does not allocate. False, and nothing changes,
    /// where there is none.
    pub(super) fn begin(&mut self, size: usize) -> bool {
        let stride = size.next_multiple_of(LANES);
        let has_room = self.values.get(..size * stride).is_some();
        if has_room {
            (self.size, self.stride) = (size, stride);
            self.values[..size * stride].fill(0.0);
        }
        has_room
    }

    /// Returns the number of rows, which is that of columns.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Returns whether it has that size, and all of its rows: one read from a file may not.
    pub(super) fn is_whole(&self, size: usize) -> bool {
        let stride = size.next_multiple_of(LANES);
        (self.size, self.stride) == (size, stride) && self.values.len() == size * stride
    }

    /// Returns row `n`, with the zeros past its end; empty beyond the last.
    #[inline(always)]
    pub fn row(&self, n: usize) -> &[f64] {
        self.values.get(n * self.stride..(n + 1) * self.stride).unwrap_or(&[])
    }

    /// Returns row `n` in whole lanes.
    #[inline(always)]
    pub(super) fn blocks(&self, n: usize) -> &[[f64; LANES]] {
        self.row(n).as_chunks().0
    }

    /// Returns a row to be changed; empty beyond the last.
    pub fn row_mut(&mut self, n: usize) -> &mut [f64] {
        self.values
            .get_mut(n * self.stride..(n + 1) * self.stride)
            .unwrap_or(&mut [])
    }
}

/// Computes `y += a x` over the first `y.len()` entries.
#[inline(always)]
pub(super) fn add_scaled(a: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

/// Returns the sum of products, in four sums side by side.
#[inline(always)]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    crate::simd::dot::<4>(a, b)
}
