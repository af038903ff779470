//! One V-cycle: an approximate inverse that conjugate gradients are preconditioned with.

use super::coarsest::Coarsest;
use super::lanes::LANES;
use super::level::Level;
use super::real::Real;
use super::smooth::{Residual, smooth};
use super::sweep::{Field, Planes, sweep, zeros};
use super::transfer::{prolong, restrict};

/// Chebyshev steps before and after the correction from the next level: as many on both sides make the cycle symmetric,
/// as conjugate gradients need in many cycles.
const STEPS: u32 = 2;
/// One step less after the correction spares a fifth of a cycle's sweeps. Where so few cycles are allowed they then
/// leave as much error as symmetric ones (paper's gland, nu 0.45, two cycles: 0.53 % for 0.48 %); in many, hard bodies
/// no longer converge.
pub(super) const FEW_CYCLES: u32 = 4;

/// Work space of one level of a cycle.
#[derive(Clone, Debug)]
pub(super) struct Stage<T> {
    /// The level's, but zero also at nodes that are held.
    pub inverse_diagonal: Vec<T>,
    pub x: Field<T>,
    pub b: Field<T>,
    d: Field<T>,
    /// Residual; between two cycles for any use, as is `x`.
    pub r: Field<T>,
}

#[derive(Clone, Debug)]
pub(super) struct Multigrid<T> {
    /// Nodes of the finest grid along x, y, z.
    pub nodes: [usize; 3],
    pub stages: Vec<Stage<T>>,
    pub work: Planes<T>,
    line: Vec<T>,
    coarsest: Coarsest<T>,
}

impl<T: Real> Multigrid<T> {
    /// Expects at least one level.
    pub fn new(levels: &[Level<T>]) -> Self {
        let stage = |level: &Level<T>| Stage {
            inverse_diagonal: level.inverse_diagonal.clone(),
            x: zeros(level.grid.len()),
            b: zeros(level.grid.len()),
            d: zeros(level.grid.len()),
            r: zeros(level.grid.len()),
        };
        Multigrid {
            nodes: levels[0].grid.nodes,
            stages: levels.iter().map(stage).collect(),
            work: Planes::new(levels[0].grid.stride * levels[0].grid.nodes[1]),
            line: vec![T::of(1.0); 2 * levels[0].grid.stride + 2 * LANES],
            coarsest: Coarsest::new(&levels[levels.len() - 1]),
        }
    }

    /// Holds the nodes `held` of the finest level, and those of the coarser ones that are in the same place.
    pub fn hold(&mut self, levels: &[Level<T>], held: &[u32]) {
        for (stage, level) in self.stages.iter_mut().zip(levels) {
            stage.inverse_diagonal.copy_from_slice(&level.inverse_diagonal);
        }
        for &node in held {
            let mut place = levels[0].grid.place(node as usize);
            for (stage, level) in self.stages.iter_mut().zip(levels) {
                stage.inverse_diagonal[level.grid.index(place)] = T::ZERO;
                if place.iter().any(|c| c % 2 == 1) {
                    break;
                }
                place = place.map(|c| c / 2);
            }
        }
        if let (Some(stage), Some(level)) = (self.stages.last(), levels.last()) {
            self.coarsest.refactor(level, &stage.inverse_diagonal, &mut self.work);
        }
    }

    /// Does one of at most `of` cycles: `stages[0].x` becomes an approximation of the solution of `A x = stages[0].b`.
    pub fn cycle(&mut self, levels: &[Level<T>], of: u32) {
        let steps_up = if of <= FEW_CYCLES { STEPS - 1 } else { STEPS };
        let last = levels.len() - 1;
        for n in 0..last {
            self.smooth(levels, n, STEPS, true);
            let (fine, coarse) = self.stages.split_at_mut(n + 1);
            let Stage {
                inverse_diagonal,
                x,
                b,
                r,
                ..
            } = &mut fine[n];
            let mut op = Residual { b, r, inverse_diagonal };
            let level = &levels[n];
            sweep(level, x, &mut self.work, 0..level.grid.nodes[2], &mut op);
            let (to, line) = (&levels[n + 1].grid, &mut self.line);
            restrict(level.simd, &level.grid, to, r, line, &mut coarse[0].b);
        }
        let stage = &mut self.stages[last];
        self.coarsest.solve(&stage.b, &mut stage.x);
        for n in (0..last).rev() {
            let (fine, coarse) = self.stages.split_at_mut(n + 1);
            let stage = &mut fine[n];
            let (from, to) = (&levels[n + 1].grid, &levels[n].grid);
            prolong(
                levels[n].simd,
                from,
                to,
                &coarse[0].x,
                &stage.inverse_diagonal,
                &mut self.line,
                &mut stage.x,
            );
            self.smooth(levels, n, steps_up, false);
        }
    }

    fn smooth(&mut self, levels: &[Level<T>], n: usize, steps: u32, from_zero: bool) {
        let Stage {
            inverse_diagonal,
            x,
            b,
            d,
            ..
        } = &mut self.stages[n];
        smooth(
            &levels[n],
            inverse_diagonal,
            [x, b, d],
            &mut self.work,
            steps,
            from_zero,
        );
    }
}
