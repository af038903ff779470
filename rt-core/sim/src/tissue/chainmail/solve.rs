//! One step: recover, hold, solve to the residual, report.

use super::follow::follow;
use super::held::{self, Grip};
use super::model::ChainMail;
use super::propagate::propagate;
use super::state::TissueState;
use super::sweep::Pass;
use crate::tissue::{Held, Solve, StepReport};

/// Advances the tissue by `dt_s`; a `dt_s` that is not above zero recovers nothing.
///
/// A state of another model is left alone and reported as not converged.
pub fn step(model: &ChainMail, state: &mut TissueState, held: Option<Held>, dt_s: f64) -> StepReport {
    let (grip, outcome) = held::grip(model, held);
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
    state.recover(model, kept_fraction(model, dt_s));
    state.moved.clear(&model.rows, model.lattice.dims[1]);
    let residual = solve(model, state, grip, &mut report);
    report.residual = f64::from(residual);
    report.moved = state.moved.element_count(&model.rows, model.lattice.dims[1]);
    report.max_displacement = state.max_displacement;
    report.converged = residual <= model.limits().tolerance && report.max_displacement.is_finite();
    report
}

fn kept_fraction(model: &ChainMail, dt_s: f64) -> f64 {
    if dt_s > 0.0 {
        (-dt_s / model.limits().recovery_time_s).exp()
    } else {
        1.0
    }
}

/// Puts the held element in place and brings the body into its limits.
fn solve(model: &ChainMail, state: &mut TissueState, mut grip: Option<Grip>, report: &mut StepReport) -> f32 {
    let farthest = grip.map_or(0.0, |g| g.at.iter().fold(0.0, |a: f32, c| a.max(c.abs())));
    let slack = slack(model, farthest.max(state.max_displacement));
    let residual = match &mut grip {
        // A step can only be undone to a state that meets the limits.
        Some(grip) if model.part_is_fixed(model.part(grip.element)) && state.residual <= model.limits().tolerance => {
            follow(model, state, grip, slack, report)
        }
        Some(grip) => {
            held::put(model, state, grip);
            propagate(model, state, grip, slack, report)
        }
        None if state.active.is_empty() => 0.0,
        None => Pass::new(model, state, [0; 3], slack).check(),
    };
    state.measure(model);
    state.residual = residual.max(state.settled);
    state.residual
}

/// Violations that f32 cannot do without: two ends at `farthest`, rounded.
fn slack(model: &ChainMail, farthest: f32) -> f32 {
    const LEAST: f32 = 1e-6;
    (LEAST + f32::EPSILON * farthest).min(0.25 * model.limits().tolerance)
}
