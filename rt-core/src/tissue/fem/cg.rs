//! Conjugate gradients, preconditioned with one multigrid cycle, on one response.

use std::ops::Range;

use super::grid::Grid;
use super::lanes::{add_scaled, dot, keep_free, keep_opposite, scale_and_add};
use super::model::FemModel;
use super::real::Real;
use super::simd::{Simd, vectorised};
use super::smooth::Product;
use super::state::FemState;
use super::sweep::{Field, LineOp, sweep};

/// `b = -A u` where nodes are free, zero elsewhere: what is left to do from `u` on where nothing pushes free nodes.
struct Opposite<'a, T> {
    b: &'a mut Field<T>,
    inverse_diagonal: &'a [T],
    square: f64,
}

impl<T: Real> LineOp<T> for Opposite<'_, T> {
    #[inline(always)]
    fn line(&mut self, at: Range<usize>, forces: [&[T]; 3], _: [&mut [T]; 3]) {
        let inverse = &self.inverse_diagonal[at.clone()];
        for (b, force) in self.b.iter_mut().zip(forces) {
            let b = &mut b[at.clone()];
            keep_opposite(inverse, force, b);
            self.square += dot(b, b);
        }
    }
}

/// Forces on all nodes, the residual on the free ones.
struct Answer<'a, T> {
    forces: &'a mut Field<T>,
    inverse_diagonal: &'a [T],
    square: f64,
}

impl<T: Real> LineOp<T> for Answer<'_, T> {
    #[inline(always)]
    fn line(&mut self, at: Range<usize>, forces: [&[T]; 3], _: [&mut [T]; 3]) {
        let inverse = &self.inverse_diagonal[at.clone()];
        for (kept, force) in self.forces.iter_mut().zip(forces) {
            // What is left on free nodes, by way of the line that the forces go to in the end.
            let kept = &mut kept[at.clone()];
            keep_free(inverse, force, kept);
            self.square += dot(kept, kept);
            kept.copy_from_slice(force);
        }
    }
}

vectorised! {
fn dot_fields<T>(grid: &Grid, a: &Field<T>, b: &Field<T>) -> f64 {
    let mut sum = 0.0;
    for at in grid.node_spans() {
        for (a, b) in a.iter().zip(b) {
            sum += dot(&a[at.clone()], &b[at.clone()]);
        }
    }
    sum
}
}

vectorised! {
fn scale_and_add_fields<T>(grid: &Grid, a: T, x: &Field<T>, y: &mut Field<T>) {
    for at in grid.node_spans() {
        for (x, y) in x.iter().zip(y.iter_mut()) {
            scale_and_add(a, &x[at.clone()], &mut y[at.clone()]);
        }
    }
}
}

vectorised! {
/// `u += alpha p`, `r -= alpha q`; returns `r . r`.
fn advance_fields<T>(grid: &Grid, alpha: T, p: &Field<T>, q: &Field<T>, u: &mut Field<T>, r: &mut Field<T>) -> f64 {
    let mut square = 0.0;
    for at in grid.node_spans() {
        for c in 0..3 {
            let r = &mut r[c][at.clone()];
            add_scaled(alpha, &p[c][at.clone()], &mut u[c][at.clone()]);
            add_scaled(-alpha, &q[c][at.clone()], r);
            square += dot(r, r);
        }
    }
    square
}
}

impl<T: Real> FemState<T> {
    /// Refines response `n` until its residual norm is at most `target` or `cycles` of a step's `of` are used up; returns those used.
    pub(super) fn refine(&mut self, model: &FemModel<T>, n: usize, target: f64, cycles: u32, of: u32) -> u32 {
        let mut used = 0;
        let mut residual = self.begin(model, n);
        let mut rz_before = 0.0;
        let mut alpha = 0.0;
        while residual > target && used < cycles {
            self.multigrid.cycle(&model.levels, of);
            used += 1;
            let (rz, zq) = self.products(model, used > 1);
            // Polak and Ribière's form: the cycle is not quite symmetric, and this one does not mind.
            let beta = if used > 1 { -alpha * zq / rz_before } else { 0.0 };
            self.turn(model, beta);
            let pq = self.product(model);
            alpha = rz / pq;
            rz_before = rz;
            if !(alpha.is_finite() && alpha > 0.0) {
                break;
            }
            residual = self.advance(model, n, alpha);
        }
        self.finish(model, n, residual, target);
        used
    }

    /// The residual of response `n` becomes the right-hand side of the cycle.
    fn begin(&mut self, model: &FemModel<T>, n: usize) -> f64 {
        let level = &model.levels[0];
        let stage = &mut self.multigrid.stages[0];
        let mut op = Opposite {
            b: &mut stage.b,
            inverse_diagonal: &stage.inverse_diagonal,
            square: 0.0,
        };
        let (u, work) = (&mut self.responses[n].u, &mut self.multigrid.work);
        sweep(level, u, work, 0..level.grid.nodes[2], &mut op);
        op.square.sqrt()
    }

    /// `r . z`, and `z . q` if there is a `q` yet.
    fn products(&self, model: &FemModel<T>, has_q: bool) -> (f64, f64) {
        let level = &model.levels[0];
        let stage = &self.multigrid.stages[0];
        let rz = dot_fields(level.simd, &level.grid, &stage.b, &stage.x);
        let zq = if has_q {
            dot_fields(level.simd, &level.grid, &stage.x, &self.q)
        } else {
            0.0
        };
        (rz, zq)
    }

    /// `p = z + beta p`.
    fn turn(&mut self, model: &FemModel<T>, beta: f64) {
        let level = &model.levels[0];
        let (z, p) = (&self.multigrid.stages[0].x, &mut self.p);
        scale_and_add_fields(level.simd, &level.grid, T::of(beta), z, p);
    }

    /// `q = A p`; returns `p . q`.
    fn product(&mut self, model: &FemModel<T>) -> f64 {
        let level = &model.levels[0];
        let multigrid = &mut self.multigrid;
        let mut op = Product {
            q: &mut self.q,
            inverse_diagonal: &multigrid.stages[0].inverse_diagonal,
            dot: 0.0,
            square: 0.0,
        };
        sweep(level, &mut self.p, &mut multigrid.work, 0..level.grid.nodes[2], &mut op);
        op.dot
    }

    /// `u += alpha p`, `r -= alpha q`; returns the norm of `r`.
    fn advance(&mut self, model: &FemModel<T>, n: usize, alpha: f64) -> f64 {
        let level = &model.levels[0];
        let (u, r) = (&mut self.responses[n].u, &mut self.multigrid.stages[0].b);
        let (p, q) = (&self.p, &self.q);
        advance_fields(level.simd, &level.grid, T::of(alpha), p, q, u, r).sqrt()
    }

    /// The force that moves the patch, and the residual: as it is where `recurred` says that it is small enough, else as
    /// the recurrence has it, which spares a sweep of all but the planes at the patch.
    fn finish(&mut self, model: &FemModel<T>, n: usize, recurred: f64, target: f64) {
        let level = &model.levels[0];
        let is_done = recurred <= target;
        let all = 0..level.grid.nodes[2];
        let planes = match self.patch {
            Some(cells) if !is_done => cells[2][0].saturating_sub(1)..(cells[2][1] + 2).min(all.end),
            _ => all,
        };
        let multigrid = &mut self.multigrid;
        let mut op = Answer {
            forces: &mut self.q,
            inverse_diagonal: &multigrid.stages[0].inverse_diagonal,
            square: 0.0,
        };
        let response = &mut self.responses[n];
        sweep(level, &mut response.u, &mut multigrid.work, planes, &mut op);
        response.residual = if is_done { op.square.sqrt() } else { recurred };
        let patch = &self.patch_nodes[..self.held];
        response.force_n_per_m = [0, 1, 2].map(|c| patch.iter().map(|&node| self.q[c][node as usize].to_f64()).sum());
    }

    /// The norm of the forces that the patch alone causes on free nodes when it is moved along `direction`.
    pub(super) fn load(&mut self, model: &FemModel<T>, direction: [f64; 3], planes: Range<usize>) -> f64 {
        let level = &model.levels[0];
        self.p.iter_mut().for_each(|c| c.fill(T::ZERO));
        for (p, part) in self.p.iter_mut().zip(direction) {
            for &node in &self.patch_nodes[..self.held] {
                p[node as usize] = T::of(part);
            }
        }
        let multigrid = &mut self.multigrid;
        let mut op = Product {
            q: &mut self.q,
            inverse_diagonal: &multigrid.stages[0].inverse_diagonal,
            dot: 0.0,
            square: 0.0,
        };
        sweep(level, &mut self.p, &mut multigrid.work, planes, &mut op);
        op.square.sqrt()
    }

    /// Half of displacement times force, over elements and springs: the elastic energy.
    pub fn strain_energy_j(&mut self, model: &FemModel<T>) -> f64 {
        let level = &model.levels[0];
        self.p.iter_mut().for_each(|c| c.fill(T::ZERO));
        for response in &self.responses[..self.count] {
            let weight = T::of(response.weight_m);
            for (p, u) in self.p.iter_mut().zip(&response.u) {
                p.iter_mut().zip(u).for_each(|(p, &u)| *p += weight * u);
            }
        }
        let mut op = Answer {
            forces: &mut self.q,
            inverse_diagonal: &self.multigrid.stages[0].inverse_diagonal,
            square: 0.0,
        };
        sweep(
            level,
            &mut self.p,
            &mut self.multigrid.work,
            0..level.grid.nodes[2],
            &mut op,
        );
        let products = self.p.iter().zip(&self.q);
        0.5 * products
            .map(|(p, q)| p.iter().zip(q).map(|(&p, &q)| (p * q).to_f64()).sum::<f64>())
            .sum::<f64>()
    }
}
