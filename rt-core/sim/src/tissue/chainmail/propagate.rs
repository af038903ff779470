//! Brings a body back into its limits around what is held: sweeps, then projections, then re-anchoring.

use super::held::{self, Grip};
use super::model::ChainMail;
use super::state::TissueState;
use super::sweep::Pass;
use crate::tissue::{HeldOutcome, Solve, StepReport};

/// Outward sweeps tried first.
const MAX_SWEEPS: u32 = 6;
/// Passes of projections tried after that.
const MAX_PROJECTIONS: u32 = 12;

/// Sweeps, then projects, then re-anchors, until the residual is within tolerance.
pub(super) fn propagate(
    model: &ChainMail,
    state: &mut TissueState,
    grip: &Grip,
    slack: f32,
    report: &mut StepReport,
) -> f32 {
    let tolerance = model.limits().tolerance;
    let mut residual = sweep(model, state, grip, slack, Patience::ToTheLast, report);
    if residual > tolerance {
        residual = project(model, state, grip, slack, report);
    }
    if residual > tolerance {
        if model.part_is_fixed(model.part(grip.element)) {
            report.held = HeldOutcome::Limited;
        }
        let mut pass = Pass::new(model, state, model.lattice.cell(grip.element), slack);
        pass.reanchor(grip.element as usize);
        residual = pass.check_all();
        report.passes += 1;
        report.solve = Solve::Reanchored;
    }
    residual
}

/// Point at which sweeps are given up.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Patience {
    ToTheLast,
    /// Once one does not halve what is left.
    WhileItHelps,
}

pub(super) fn sweep(
    model: &ChainMail,
    state: &mut TissueState,
    grip: &Grip,
    slack: f32,
    patience: Patience,
    report: &mut StepReport,
) -> f32 {
    let held_cell = model.lattice.cell(grip.element);
    let mut residual = 0.0;
    // A sweep of what little is left costs little: go on to the last that f32 can do, within their number.
    for number in 0..MAX_SWEEPS {
        if state.active.is_empty() {
            break;
        }
        let before = residual;
        residual = Pass::new(model, state, held_cell, slack).outward();
        // A patch with holes in it can be reached from outside, and bone pushes back; put back, it is active again.
        let may_be_reached = grip.beside > 0 || model.classes.any_fixed();
        if may_be_reached && held::put(model, state, grip) {
            residual = f32::INFINITY;
        }
        report.passes += 1;
        report.solve = report.solve.max(Solve::Sweeps);
        let helps = number == 0 || residual < 0.5 * before || residual <= model.limits().tolerance;
        if patience == Patience::WhileItHelps && !helps {
            break;
        }
    }
    residual
}

/// Passes of projections over the whole body.
fn project(model: &ChainMail, state: &mut TissueState, grip: &Grip, slack: f32, report: &mut StepReport) -> f32 {
    let mut residual = f32::INFINITY;
    for number in 0..MAX_PROJECTIONS {
        let mut pass = Pass::new(model, state, [0; 3], slack);
        pass.project(number.is_multiple_of(2));
        held::put(model, pass.state, grip);
        residual = pass.check_all();
        report.passes += 1;
        report.solve = report.solve.max(Solve::Projections);
        if residual <= model.limits().tolerance {
            break;
        }
    }
    residual
}
