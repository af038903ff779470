//! The elements that a needle holds: one, or a cube of them.

use super::model::ChainMail;
use super::state::TissueState;
use super::stretch::Stretch;
use crate::tissue::{Held, HeldOutcome, REACH};

/// A held element and where it goes, in elements from rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grip {
    pub element: u32,
    pub at: [f32; 3],
    /// Neighbours along each axis that go along.
    pub beside: usize,
}

/// Returns the grip of a step, if it can be followed.
pub(super) fn grip(model: &ChainMail, held: Option<Held>) -> (Option<Grip>, HeldOutcome) {
    let Some(held) = held else {
        return (None, HeldOutcome::None);
    };
    let (rest, h) = (model.lattice.rest_m(held.element), model.lattice.spacing_m);
    let at = [0, 1, 2].map(|a| (held.position_m[a] - rest[a]) / h);
    let known = (held.element as usize) < model.element_count();
    // Centres within half the edge; slightly more, as the quotient may be a whole number.
    let beside = 0.5 * held.patch_m / h + 1e-6;
    if !known || !at.iter().all(|c| c.abs() <= REACH) || !(0.0..=REACH).contains(&beside) {
        return (None, HeldOutcome::Refused);
    }
    if model.is_fixed(held.element) {
        return (None, HeldOutcome::Limited);
    }
    let grip = Grip {
        element: held.element,
        at: at.map(|c| c as f32),
        beside: beside as usize,
    };
    (Some(grip), HeldOutcome::Followed)
}

/// Puts what is held in place; what that moves is active. Whether anything was not there.
pub(super) fn put(model: &ChainMail, state: &mut TissueState, grip: &Grip) -> bool {
    let cell = model.lattice.cell(grip.element);
    let [cells, rows, planes] = [0, 1, 2].map(|axis| {
        let end = (cell[axis] + grip.beside + 1).min(model.lattice.dims[axis]);
        cell[axis].saturating_sub(grip.beside)..end
    });
    let wanted = Stretch {
        start: cells.start as u32,
        end: cells.end as u32,
    };
    let part = model.part(grip.element);
    let mut moved = false;
    for [j, k] in planes.flat_map(|k| rows.clone().map(move |j| [j, k])) {
        for run in model.rows.numbers(j + model.lattice.dims[1] * k) {
            if model.part_of_run(run) == part {
                let of_run = model.rows.runs[run];
                for n in wanted.within(of_run.start_i, of_run.len).numbers() {
                    moved |= put_one(model, state, of_run.first + n as u32, run, grip.at, [j, k]);
                }
            }
        }
    }
    moved
}

fn put_one(
    model: &ChainMail,
    state: &mut TissueState,
    element: u32,
    run: usize,
    at: [f32; 3],
    [j, k]: [usize; 2],
) -> bool {
    if model.is_fixed(element) {
        return false;
    }
    state.keep(model, run);
    if !state.put(element as usize, at) {
        return false;
    }
    let one = Stretch::one(element as usize);
    state.active.add(run, one);
    state.active.add_row(j, k);
    state.moved.add(run, one);
    state.moved.add_row(j, k);
    true
}
