//! One step: recover, hold, solve to the residual, report.

use super::held::{self, Grip};
use super::kernels::{Kernels, Portable};
use super::model::ChainMail;
use super::state::TissueState;
use super::sweep::Pass;
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
    let residual = dispatch(model, state, grip, &mut report);
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

fn dispatch(model: &ChainMail, state: &mut TissueState, grip: Option<Grip>, report: &mut StepReport) -> f32 {
    #[cfg(target_arch = "x86_64")]
    if model.vectors {
        // SAFETY: `vectors` says that the processor has AVX2.
        return unsafe { solve_avx2(model, state, grip, report) };
    }
    solve::<Portable>(model, state, grip, report)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn solve_avx2(model: &ChainMail, state: &mut TissueState, grip: Option<Grip>, report: &mut StepReport) -> f32 {
    solve::<super::avx2::Avx2>(model, state, grip, report)
}

/// Puts the held element in place, then sweeps, then projects, then re-anchors, until the residual is within tolerance.
#[inline(always)]
fn solve<K: Kernels>(model: &ChainMail, state: &mut TissueState, grip: Option<Grip>, report: &mut StepReport) -> f32 {
    let farthest = grip.map_or(0.0, |g| g.at.iter().fold(0.0, |a: f32, c| a.max(c.abs())));
    let slack = slack(model, farthest.max(state.max_displacement));
    let residual = match grip {
        Some(grip) => hold::<K>(model, state, grip, slack, report),
        None if state.active.is_empty() => 0.0,
        None => Pass::new(model, state, [0; 3], slack).check::<K>(),
    };
    state.measure(model, K::largest_square);
    residual.max(state.settled)
}

/// Violations that f32 cannot do without: two ends at `farthest`, rounded.
fn slack(model: &ChainMail, farthest: f32) -> f32 {
    const LEAST: f32 = 4e-6;
    (LEAST + 2.0 * f32::EPSILON * farthest).min(0.25 * model.limits().tolerance)
}

#[inline(always)]
fn hold<K: Kernels>(
    model: &ChainMail,
    state: &mut TissueState,
    grip: Grip,
    slack: f32,
    report: &mut StepReport,
) -> f32 {
    let tolerance = model.limits().tolerance;
    let held_cell = model.lattice.cell(grip.element);
    held::put(model, state, &grip);
    loop {
        if state.active.is_empty() {
            return 0.0;
        }
        let stage = match report.passes {
            n if n < MAX_SWEEPS => Solve::Sweeps,
            n if n < MAX_SWEEPS + MAX_PROJECTIONS => Solve::Projections,
            _ => Solve::Reanchored,
        };
        let mut pass = Pass::new(model, state, held_cell, slack);
        let residual = match stage {
            Solve::Sweeps => pass.outward::<K>(),
            Solve::Projections => {
                pass.project(report.passes.is_multiple_of(2));
                held::put(model, pass.state, &grip);
                pass.check_all::<K>()
            }
            _ => {
                pass.reanchor(grip.element as usize);
                if model.part_is_fixed(model.part(grip.element)) {
                    report.held = HeldOutcome::Limited;
                }
                pass.check_all::<K>()
            }
        };
        report.passes += 1;
        report.solve = report.solve.max(stage);
        if residual <= tolerance || stage == Solve::Reanchored {
            return residual;
        }
    }
}
