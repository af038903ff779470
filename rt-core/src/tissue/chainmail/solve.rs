//! One step: recover, hold, solve to the residual, report.

use super::model::{ChainMail, TissueState};
use super::{project, sweep};
use crate::tissue::check::largest_violation_f32;
use crate::tissue::{Held, HeldOutcome, Solve, StepReport};

/// Outward sweeps tried first.
pub const MAX_SWEEPS: u32 = 6;
/// Passes of projections tried after that.
pub const MAX_PROJECTIONS: u32 = 12;
/// Farthest from rest that a held element is followed, in elements; f32 resolves the tolerance up to here.
pub const REACH: f64 = 2048.0;

/// Advances the tissue by `dt_s`; a `dt_s` that is not above zero recovers nothing.
///
/// A state of another model is left alone and reported as not converged.
pub fn step(model: &ChainMail, state: &mut TissueState, held: Option<Held>, dt_s: f64) -> StepReport {
    let (target, outcome) = held_target(model, held);
    let mut report = StepReport {
        passes: 0,
        residual: f64::INFINITY,
        moved: 0,
        converged: false,
        max_displacement: state.max_displacement,
        held: outcome,
        solve: Solve::Nothing,
        tip_force_n: None,
    };
    if !state.fits(model) {
        return report;
    }
    recover(state, kept_fraction(model, dt_s));
    for (before, now) in state.before.iter_mut().zip(&state.u) {
        before.copy_from_slice(now);
    }
    let residual = match target {
        Some((element, u)) => solve(model, state, element, u, &mut report),
        None => largest_violation_f32(model, state),
    };
    report.residual = f64::from(residual);
    measure_motion(state, &mut report);
    state.max_displacement = report.max_displacement;
    report.converged = residual <= model.limits.tolerance && report.max_displacement.is_finite();
    report
}

/// The held element and its displacement, if it can be followed.
fn held_target(model: &ChainMail, held: Option<Held>) -> (Option<(usize, [f32; 3])>, HeldOutcome) {
    let Some(held) = held else {
        return (None, HeldOutcome::None);
    };
    let rest = model.lattice.rest_m(held.element);
    let u = [0, 1, 2].map(|a| (held.position_m[a] - rest[a]) / model.lattice.spacing_m);
    let known = (held.element as usize) < model.element_count();
    if known && u.iter().all(|c| c.abs() <= REACH) {
        let u = u.map(|c| c as f32);
        (Some((held.element as usize, u)), HeldOutcome::Followed)
    } else {
        (None, HeldOutcome::Refused)
    }
}

fn kept_fraction(model: &ChainMail, dt_s: f64) -> f32 {
    if dt_s > 0.0 {
        (-dt_s / model.limits.recovery_time_s).exp() as f32
    } else {
        1.0
    }
}

/// Displacements below this become zero, long before they become denormal and slow.
const AT_REST: f32 = 1e-12;

/// Recovery by the surroundings: differences shrink in proportion, so no limit is broken.
fn recover(state: &mut TissueState, kept: f32) {
    for component in &mut state.u {
        for value in component {
            let left = *value * kept;
            *value = if left.abs() > AT_REST { left } else { 0.0 };
        }
    }
}

/// Puts the held element in place, then sweeps, then projects, then re-anchors, until the residual is within tolerance.
fn solve(model: &ChainMail, state: &mut TissueState, held: usize, at: [f32; 3], report: &mut StepReport) -> f32 {
    let tolerance = model.limits.tolerance;
    let held_cell = model.lattice.cell(held as u32);
    state.put(held, at);
    loop {
        let stage = match report.passes {
            n if n < MAX_SWEEPS => Solve::Sweeps,
            n if n < MAX_SWEEPS + MAX_PROJECTIONS => Solve::Projections,
            _ => Solve::Reanchored,
        };
        match stage {
            Solve::Reanchored => project::reanchor(model, held, &mut state.u),
            Solve::Projections => {
                project::project_all(model, report.passes.is_multiple_of(2), &mut state.u);
                state.put(held, at);
            }
            _ => sweep::outward(model, held_cell, &mut state.u),
        }
        report.passes += 1;
        report.solve = report.solve.max(stage);
        let residual = largest_violation_f32(model, state);
        if residual <= tolerance || stage == Solve::Reanchored {
            return residual;
        }
    }
}

fn measure_motion(state: &TissueState, report: &mut StepReport) {
    let n = state.u[0].len();
    let [x, y, z] = state.u.each_ref().map(|c| &c[..n]);
    let [bx, by, bz] = state.before.each_ref().map(|c| &c[..n]);
    // Bits of squares, which are not below zero, have the order of the squares (see `violation`); a NaN
    // is above all of them once its sign is off.
    let (mut moved, mut largest) = (0_i32, 0_i32);
    for e in 0..n {
        let same = (x[e] == bx[e]) & (y[e] == by[e]) & (z[e] == bz[e]);
        moved += i32::from(!same);
        let square = x[e] * x[e] + y[e] * y[e] + z[e] * z[e];
        largest = largest.max(square.abs().to_bits() as i32);
    }
    let largest = f32::from_bits(largest as u32);
    report.moved = moved as u32;
    report.max_displacement = if largest.is_finite() {
        largest.sqrt()
    } else {
        f32::INFINITY
    };
}
