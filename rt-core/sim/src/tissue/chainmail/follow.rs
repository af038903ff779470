//! Following the needle where something is fixed: a step that cannot be solved is undone and tried shorter.
//!
//! The state before the step meets every limit, so the worst that happens is that the tissue stays where it is.

use super::held::{self, Grip};
use super::kernels;
use super::model::ChainMail;
use super::propagate::{Patience, sweep};
use super::state::TissueState;
use super::sweep::Pass;
use crate::tissue::{HeldOutcome, StepReport};

/// Tries after the whole way; each a quarter of the one before.
const SHORTER_TRIES: i32 = 3;
/// Longest first step, in elements: half of the way that was asked, but no farther.
const FIRST_SHORTER: f32 = 1.0;

/// Moves the held elements toward their target, as far as sweeps can follow; `grip` then has the distance.
pub(super) fn follow(
    model: &ChainMail,
    state: &mut TissueState,
    grip: &mut Grip,
    slack: f32,
    report: &mut StepReport,
) -> f32 {
    let scale = state.scale();
    let from = kernels::at(&state.u.each_mut().map(Vec::as_mut_slice), grip.element as usize).map(|c| c * scale);
    let way = [0, 1, 2].map(|a| grip.at[a] - from[a]);
    let asked = way.iter().map(|c| c * c).sum::<f32>().sqrt();
    state.begin_trial();
    for tried in 0..=SHORTER_TRIES {
        if tried > 0 {
            let length = (0.5 * asked).min(FIRST_SHORTER) * 0.25_f32.powi(tried - 1);
            grip.at = [0, 1, 2].map(|a| from[a] + way[a] * (length / asked));
        }
        held::put(model, state, grip);
        let residual = sweep(model, state, grip, slack, Patience::WhileItHelps, report);
        if residual <= model.limits().tolerance {
            state.end_trial();
            return residual;
        }
        report.held = HeldOutcome::Limited;
        state.undo(model);
        if asked == 0.0 {
            break;
        }
    }
    state.end_trial();
    grip.at = from;
    Pass::new(model, state, model.lattice.cell(grip.element), slack).check()
}
