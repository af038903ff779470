//! Conjugate gradients, preconditioned with one multigrid cycle, on one response.

use std::ops::Range;

use super::grid::Grid;
use super::grip::{Grip, Iteration};
use super::lanes::{dot, update, where_free};
use super::model::FemModel;
use super::multigrid::{FEW_CYCLES, Stage};
use super::real::Real;
use super::smooth::Product;
use super::sweep::{Field, LineOp, sweep};
use crate::simd::{Simd, vectorised};

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
            where_free(inverse, force, b, |force| -force);
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
            // The residual on free nodes, in the line that the forces go to afterwards.
            let kept = &mut kept[at.clone()];
            where_free(inverse, force, kept, |force| force);
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
            update(&x[at.clone()], &mut y[at.clone()], |x, y| x + a * y);
        }
    }
}
}

vectorised! {
/// Computes `u += alpha p`, `r -= alpha q`; returns `r . r`.
fn advance_fields<T>(grid: &Grid, alpha: T, p: &Field<T>, q: &Field<T>, u: &mut Field<T>, r: &mut Field<T>) -> f64 {
    let mut square = 0.0;
    for at in grid.node_spans() {
        for c in 0..3 {
            let r = &mut r[c][at.clone()];
            update(&p[c][at.clone()], &mut u[c][at.clone()], |p, u| u + alpha * p);
            update(&q[c][at.clone()], r, |q, r| r + -alpha * q);
            square += dot(r, r);
        }
    }
    square
}
}

/// Target of a refinement.
pub(super) struct Goal {
    /// Norm of the residual that is to be met.
    pub residual: f64,
    /// Residual below which no second cycle is begun.
    pub rough: f64,
    pub cycles: u32,
    /// Cycles that a step may take at most.
    pub of: u32,
}

impl<T: Real> Grip<T> {
    /// Refines response `n` as far as the goal says; returns the cycles used.
    pub(super) fn refine(&mut self, model: &FemModel<T>, n: usize, goal: &Goal) -> u32 {
        let going_on = self.iteration.take().filter(|c| c.response == n);
        let mut iteration = going_on.unwrap_or_else(|| self.begin(model, n));
        let mut used = 0;
        let mut is_sound = true;
        let wanted = |used| if used == 0 { goal.residual } else { goal.rough };
        while used < goal.cycles && is_sound && iteration.residual > wanted(used) {
            used += 1;
            is_sound = self.advance(model, &mut iteration, goal.of);
        }
        self.finish(model, n, iteration.residual, goal.residual);
        // The cycles of few are not quite symmetric, which many in a row would mind.
        let is_short = goal.of > FEW_CYCLES || iteration.cycles < FEW_CYCLES;
        let goes_on = is_sound && is_short && iteration.residual > goal.residual;
        self.iteration = goes_on.then_some(iteration);
        used
    }

    /// Does one cycle; returns false where the equations let it come no nearer.
    fn advance(&mut self, model: &FemModel<T>, iteration: &mut Iteration, of: u32) -> bool {
        self.multigrid.cycle(&model.levels, of);
        let is_first = iteration.cycles == 0;
        iteration.cycles += 1;
        let (rz, zq) = self.products(model, !is_first);
        // Polak and Ribière's form: the cycle is not quite symmetric, and this one does not mind.
        let beta = if is_first {
            0.0
        } else {
            -iteration.alpha * zq / iteration.rz
        };
        self.turn(model, beta);
        let pq = self.product(model);
        (iteration.rz, iteration.alpha) = (rz, rz / pq);
        let is_sound = iteration.alpha.is_finite() && iteration.alpha > 0.0;
        if is_sound {
            iteration.residual = self.go_along(model, iteration.response, iteration.alpha);
        }
        is_sound
    }

    /// Begins with the residual of response `n` as the right-hand side of the cycle.
    fn begin(&mut self, model: &FemModel<T>, n: usize) -> Iteration {
        let level = &model.levels[0];
        let stage = &mut self.multigrid.stages[0];
        let mut op = Opposite {
            b: &mut stage.b,
            inverse_diagonal: &stage.inverse_diagonal,
            square: 0.0,
        };
        let (u, work) = (&mut self.responses[n].u, &mut self.multigrid.work);
        sweep(level, u, work, 0..level.grid.nodes[2], &mut op);
        Iteration {
            response: n,
            cycles: 0,
            residual: op.square.sqrt(),
            rz: 0.0,
            alpha: 0.0,
        }
    }

    /// Returns `r . z`, and `z . q` if there is a `q` yet.
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

    /// Computes `p = z + beta p`.
    fn turn(&mut self, model: &FemModel<T>, beta: f64) {
        let level = &model.levels[0];
        let (z, p) = (&self.multigrid.stages[0].x, &mut self.p);
        scale_and_add_fields(level.simd, &level.grid, T::of(beta), z, p);
    }

    /// Computes `q = A p`; returns `p . q`.
    fn product(&mut self, model: &FemModel<T>) -> f64 {
        let level = &model.levels[0];
        let multigrid = &mut self.multigrid;
        let mut op = Product {
            q: &mut self.q,
            inverse_diagonal: &multigrid.stages[0].inverse_diagonal,
            dot: 0.0,
        };
        sweep(level, &mut self.p, &mut multigrid.work, 0..level.grid.nodes[2], &mut op);
        op.dot
    }

    /// Computes `u += alpha p`, `r -= alpha q`; returns the norm of `r`.
    fn go_along(&mut self, model: &FemModel<T>, n: usize, alpha: f64) -> f64 {
        let level = &model.levels[0];
        let (u, r) = (&mut self.responses[n].u, &mut self.multigrid.stages[0].b);
        let (p, q) = (&self.p, &self.q);
        advance_fields(level.simd, &level.grid, T::of(alpha), p, q, u, r).sqrt()
    }

    /// Computes the force that moves the patch, and the residual: the true one where `recurred` is small enough, else
    /// that of the recurrence, which spares a sweep of all but the planes at the patch.
    fn finish(&mut self, model: &FemModel<T>, n: usize, recurred: f64, target: f64) {
        let level = &model.levels[0];
        let is_done = recurred <= target;
        let planes = if is_done {
            0..level.grid.nodes[2]
        } else {
            self.planes(model)
        };
        let multigrid = &mut self.multigrid;
        let stage = &mut multigrid.stages[0];
        // `r` is the cycle's, which has no use for it between two; `q` is needed further.
        let mut op = Answer {
            forces: &mut stage.r,
            inverse_diagonal: &stage.inverse_diagonal,
            square: 0.0,
        };
        sweep(level, &mut self.responses[n].u, &mut multigrid.work, planes, &mut op);
        let residual = if is_done { op.square.sqrt() } else { recurred };
        let force_n_per_m = self.patch_force();
        let response = &mut self.responses[n];
        (response.residual, response.force_n_per_m) = (residual, force_n_per_m);
    }

    /// Returns the planes of nodes that the elements around the patch touch.
    fn planes(&self, model: &FemModel<T>) -> Range<usize> {
        let end = model.levels[0].grid.nodes[2];
        match self.cells {
            Some([_, _, [low, high]]) => low.saturating_sub(1)..(high + 2).min(end),
            None => 0..end,
        }
    }

    /// Returns the sum over the patch of the forces in `r`.
    fn patch_force(&self) -> [f64; 3] {
        let force = |c: &Vec<T>| self.nodes().iter().map(|&node| c[node as usize].to_f64()).sum();
        self.multigrid.stages[0].r.each_ref().map(force)
    }

    /// Computes the effect of the patch alone, moved by one metre along `direction`: the norm of the forces on free
    /// nodes, and the force that moves it.
    pub(super) fn load(&mut self, model: &FemModel<T>, direction: [f64; 3]) -> (f64, [f64; 3]) {
        let planes = self.planes(model);
        let x = &mut self.multigrid.stages[0].x;
        for (x, part) in x.iter_mut().zip(direction) {
            x.fill(T::ZERO);
            for &node in &self.nodes[..self.held] {
                x[node as usize] = T::of(part);
            }
        }
        let square = self.answer_to_x(model, planes);
        (square.sqrt(), self.patch_force())
    }

    /// Leaves the forces that `x` causes in `r`; returns the square of those on free nodes.
    fn answer_to_x(&mut self, model: &FemModel<T>, planes: Range<usize>) -> f64 {
        let Stage {
            x, r, inverse_diagonal, ..
        } = &mut self.multigrid.stages[0];
        let mut op = Answer {
            forces: r,
            inverse_diagonal,
            square: 0.0,
        };
        sweep(&model.levels[0], x, &mut self.multigrid.work, planes, &mut op);
        op.square
    }

    /// Returns the elastic energy: half of displacement times force, over elements and springs.
    #[cfg(test)]
    pub fn strain_energy_j(&mut self, model: &FemModel<T>) -> f64 {
        super::guess::superpose(&self.responses[..self.count], 1.0, &mut self.multigrid.stages[0].x);
        self.answer_to_x(model, 0..model.levels[0].grid.nodes[2]);
        let Stage { x, r, .. } = &self.multigrid.stages[0];
        let work = |(x, r): (&Vec<T>, &Vec<T>)| x.iter().zip(r).map(|(&x, &r)| (x * r).to_f64()).sum::<f64>();
        0.5 * x.iter().zip(r).map(work).sum::<f64>()
    }
}
