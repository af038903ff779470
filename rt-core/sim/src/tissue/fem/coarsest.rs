//! The coarsest level, solved directly: a dense Cholesky factor in f64, made again when the fixed nodes change.

use super::level::Level;
use super::real::Real;
use super::smooth::Product;
use super::sweep::{Field, Planes, sweep, zeros};

#[derive(Clone, Debug)]
pub(super) struct Coarsest<T> {
    /// Free nodes, the first `free` of the allocation in use.
    nodes: Vec<u32>,
    /// Lower triangle, row by row with stride `3 * capacity`.
    factor: Vec<f64>,
    values: Vec<f64>,
    free: usize,
    unit: Field<T>,
    answer: Field<T>,
}

impl<T: Real> Coarsest<T> {
    pub fn new(level: &Level<T>) -> Self {
        let capacity = level.inverse_diagonal.iter().filter(|&&d| d != T::ZERO).count();
        Coarsest {
            nodes: vec![1; capacity],
            factor: vec![1.0; 9 * capacity * capacity],
            values: vec![1.0; 3 * capacity],
            free: 0,
            unit: zeros(level.grid.len()),
            answer: zeros(level.grid.len()),
        }
    }

    /// Assembles and factors, unless the same nodes are free as before; a direction without stiffness is left where it
    /// is.
    pub fn refactor(&mut self, level: &Level<T>, inverse_diagonal: &[T], work: &mut Planes<T>) {
        let free = inverse_diagonal.iter().enumerate().filter(|(_, d)| **d != T::ZERO);
        let known = self.nodes[..self.free].iter().map(|&node| node as usize);
        if self.free > 0 && known.eq(free.clone().map(|(node, _)| node)) {
            return;
        }
        self.free = 0;
        for (slot, (node, _)) in self.nodes.iter_mut().zip(free) {
            *slot = node as u32;
            self.free += 1;
        }
        let stride = self.values.len();
        for column in 0..3 * self.free {
            let (node, component) = (self.nodes[column / 3] as usize, column % 3);
            self.unit[component][node] = T::of(1.0);
            let mut op = Product {
                q: &mut self.answer,
                inverse_diagonal,
                dot: 0.0,
            };
            sweep(level, &mut self.unit, work, 0..level.grid.nodes[2], &mut op);
            self.unit[component][node] = T::ZERO;
            for row in column..3 * self.free {
                self.factor[row * stride + column] = self.answer[row % 3][self.nodes[row / 3] as usize].to_f64();
            }
        }
        self.decompose(stride);
    }

    fn decompose(&mut self, stride: usize) {
        let n = 3 * self.free;
        let largest = (0..n).map(|i| self.factor[i * stride + i]).fold(0.0, f64::max);
        for row in 0..n {
            let (above, this) = self.factor.split_at_mut(row * stride);
            let this = &mut this[..=row];
            for column in 0..row {
                let other = &above[column * stride..column * stride + column + 1];
                let known: f64 = this[..column].iter().zip(other).map(|(a, b)| a * b).sum();
                // The diagonal holds inverses; zero for a direction without stiffness.
                this[column] = (this[column] - known) * other[column];
            }
            let known: f64 = this[..row].iter().map(|a| a * a).sum();
            let pivot = this[row] - known;
            let stiff = pivot > 64.0 * T::EPSILON * largest;
            this[row] = if stiff { 1.0 / pivot.sqrt() } else { 0.0 };
        }
    }

    /// Solves `A x = b`.
    pub fn solve(&mut self, b: &Field<T>, x: &mut Field<T>) {
        let (n, stride) = (3 * self.free, self.values.len());
        for row in 0..n {
            let factor = &self.factor[row * stride..row * stride + row + 1];
            let known: f64 = factor[..row].iter().zip(&self.values).map(|(a, v)| a * v).sum();
            let b = b[row % 3][self.nodes[row / 3] as usize].to_f64();
            self.values[row] = (b - known) * factor[row];
        }
        for row in (0..n).rev() {
            let factor = &self.factor[row * stride..row * stride + row + 1];
            let value = self.values[row] * factor[row];
            self.values[row] = value;
            for (left, a) in self.values[..row].iter_mut().zip(factor) {
                *left -= a * value;
            }
        }
        x.iter_mut().for_each(|c| c.fill(T::ZERO));
        for row in 0..n {
            x[row % 3][self.nodes[row / 3] as usize] = T::of(self.values[row]);
        }
    }
}
