//! One step: grip the held patch, refine the responses, superpose, report.

use super::cg::Goal;
use super::grip::{Grip, NEW_DIRECTION, dot};
use super::model::FemModel;
use super::multigrid::FEW_CYCLES;
use super::output;
use super::real::Real;
use super::state::FemState;
use crate::tissue::{Held, HeldOutcome, REACH};

/// Part of the displacement outside the known directions, from which a direction to come is prepared.
const EXPECTED_DIRECTION: f64 = 0.02;
/// Tolerances of residual above which cycles after the first are done where few are allowed: the rest is then a few
/// thousandths of the displacement, and can wait for the next ticks.
const ROUGH: f64 = 10.0;

/// Tolerance and budget of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveSettings {
    /// Forces left on free nodes, relative to those that the moved patch would cause in a body at rest.
    pub relative_tolerance: f64,
    /// Multigrid cycles in one step, at most.
    pub max_cycles: u32,
}

/// Outcome of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FemReport {
    /// Outcome for the held patch.
    pub held: HeldOutcome,
    /// Multigrid cycles that the step took.
    pub cycles: u32,
    /// Residual as in `SolveSettings::relative_tolerance`, measured after the step.
    pub relative_residual: f64,
    /// Within the tolerance, and finite.
    pub converged: bool,
    /// Force with which the tip moves the patch; the tissue pushes the tip with the opposite.
    pub tip_force_n: [f64; 3],
    /// Elements that moved in this step.
    pub moved: u32,
    /// Largest distance of an element from rest, in elements.
    pub max_displacement: f32,
}

pub(super) fn step_held<T: Real>(
    model: &FemModel<T>,
    state: &mut FemState<T>,
    held: Option<Held>,
    settings: &SolveSettings,
) -> FemReport {
    if !state.fits(model) {
        return report(state, HeldOutcome::Refused, 0, f64::INFINITY, settings);
    }
    state.has_time = false;
    let Some(held) = held else {
        if state.grip.is_moved() {
            // What was prepared was for the way that the needle was on.
            state.next.drop_patch();
        }
        state.grip.release();
        state.has_time = true;
        let moved = output::write(model, state);
        return FemReport {
            moved,
            ..report(state, HeldOutcome::None, 0, 0.0, settings)
        };
    };
    match cells_of(model, &held) {
        Some((cells, by_m)) => hold_cells(model, state, cells, by_m, settings),
        None => report(state, HeldOutcome::Refused, 0, f64::INFINITY, settings),
    }
}

fn report<T: Real>(
    state: &FemState<T>,
    held: HeldOutcome,
    cycles: u32,
    relative_residual: f64,
    settings: &SolveSettings,
) -> FemReport {
    let used = state.grip.used();
    FemReport {
        held,
        cycles,
        relative_residual,
        converged: relative_residual <= settings.relative_tolerance && state.max_displacement.is_finite(),
        tip_force_n: [0, 1, 2].map(|c| used.iter().map(|r| r.weight_m * r.force_n_per_m[c]).sum()),
        moved: 0,
        max_displacement: state.max_displacement,
    }
}

/// Returns the cells of the finest grid that a patch holds, and how far it moves them.
fn cells_of<T: Real>(model: &FemModel<T>, held: &Held) -> Option<([[usize; 2]; 3], [f64; 3])> {
    let (lattice, grid) = (&model.lattice, &model.levels[0].grid);
    if held.element as usize >= model.element_count() || !(0.0..f64::INFINITY).contains(&held.patch_m) {
        return None;
    }
    let rest = lattice.rest_m(held.element);
    let by_m = [0, 1, 2].map(|a| held.position_m[a] - rest[a]);
    if !by_m.iter().all(|c| c.abs() <= REACH * lattice.spacing_m) {
        return None;
    }
    let cell = lattice.cell(held.element);
    let reach = (0.5 * held.patch_m / lattice.spacing_m + 1e-9).floor() as usize;
    let cells = [0, 1, 2].map(|a| {
        let centre = cell[a] - model.low_cell[a];
        [
            centre.saturating_sub(reach),
            centre.saturating_add(reach).saturating_add(1).min(grid.nodes[a] - 1),
        ]
    });
    Some((cells, by_m))
}

/// Holds the nodes of all elements in a box of cells of the finest grid, moved by `by_m` from rest.
pub(in crate::tissue) fn hold_cells<T: Real>(
    model: &FemModel<T>,
    state: &mut FemState<T>,
    cells: [[usize; 2]; 3],
    by_m: [f64; 3],
    settings: &SolveSettings,
) -> FemReport {
    let (mut cycles, mut residual) = (0, 0.0);
    if dot(by_m, by_m) == 0.0 {
        state.grip.release();
    } else {
        if state.grip.cells != Some(cells) {
            if !state.next.is_for(cells, by_m) && !state.next.take_up(model, cells, by_m, &state.grip) {
                return report(state, HeldOutcome::Refused, 0, f64::INFINITY, settings);
            }
            std::mem::swap(&mut state.grip, &mut state.next);
        }
        state.grip.weigh(model, by_m, NEW_DIRECTION);
        (cycles, residual) = refine(model, &mut state.grip, settings, settings.max_cycles);
    }
    state.has_time = cycles == 0;
    let moved = output::write(model, state);
    FemReport {
        moved,
        ..report(state, HeldOutcome::Followed, cycles, residual, settings)
    }
}

pub(super) fn prepare_next<T: Real>(
    model: &FemModel<T>,
    state: &mut FemState<T>,
    next: Option<Held>,
    settings: &SolveSettings,
) {
    if !state.fits(model) || !std::mem::take(&mut state.has_time) {
        return;
    }
    let Some((cells, by_m)) = next.and_then(|next| cells_of(model, &next)) else {
        return;
    };
    if dot(by_m, by_m) == 0.0 || state.grip.cells == Some(cells) {
        return;
    }
    // What cannot be held is refused when it is.
    if !state.next.is_for(cells, by_m) && !state.next.take_up(model, cells, by_m, &state.grip) {
        return;
    }
    state.next.weigh(model, by_m, EXPECTED_DIRECTION);
    refine(model, &mut state.next, settings, 1);
}

/// Refines the response that has most left to do until all together meet the tolerance.
fn refine<T: Real>(model: &FemModel<T>, grip: &mut Grip<T>, settings: &SolveSettings, max_cycles: u32) -> (u32, f64) {
    let rough = if settings.max_cycles <= FEW_CYCLES { ROUGH } else { 1.0 };
    let mut cycles = 0;
    loop {
        let used = grip.used();
        let load = used.iter().map(|r| (r.weight_m * r.load).powi(2)).sum::<f64>().sqrt();
        let left = |n: usize| (used[n].weight_m * used[n].residual).abs();
        let residual = (0..used.len()).map(left).sum::<f64>() / load;
        let most = (0..used.len())
            .max_by(|&a, &b| left(a).total_cmp(&left(b)))
            .unwrap_or(0);
        if load == 0.0 {
            return (cycles, 0.0);
        }
        let is_enough = cycles > 0 && residual <= rough * settings.relative_tolerance;
        if residual <= settings.relative_tolerance || cycles >= max_cycles || is_enough {
            return (cycles, residual);
        }
        let is_unknown = used[most].residual == f64::INFINITY;
        let share = settings.relative_tolerance * load / used.len() as f64;
        let target = 0.9 * share / used[most].weight_m.abs();
        let goal = Goal {
            residual: target,
            rough: rough * target,
            cycles: max_cycles - cycles,
            of: settings.max_cycles,
        };
        let spent = grip.refine(model, most, &goal);
        if spent == 0 && !is_unknown {
            return (cycles, residual);
        }
        cycles += spent;
    }
}
