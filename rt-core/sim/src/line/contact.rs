//! The needle against the tissue on its line, once a tick: Coulomb friction with anchors in the tissue, membranes, cutting.
//!
//! Each station of the shaft sticks to the tissue until the force between them reaches the friction of its length, and slips
//! with that force from then on. The tip pushes, and never pulls: against a membrane up to the force at which it gives way, in tissue up
//! to the cutting force. All at once this is a convex problem with one solution, which is found from that of the last tick: by projected
//! Gauss-Seidel, or by sets of stations that stick (`sets`) where the settings ask for it and no rate term is on. Nothing depends on speed
//! unless a rate term is asked for.

use super::model::LineModel;
use super::rows::{add_scaled, dot};
use super::state::{LineOutput, LineState};
use super::tip::follow;
use crate::simd::{Simd, vectorised};
use sets::{Scratch, Tip};

mod sets;

/// Solutions in one tick at most: the tip goes on, a membrane gives way, the tip goes on again.
pub(super) const MAX_PASSES: u32 = 12;
/// A gap at the tip that another pass would be wasted on.
pub(super) const CLOSED_M: f64 = 1e-7;
/// The line is not followed further than this from its entry.
pub(super) const FURTHEST_M: f64 = 10.0;

/// Where the needle is in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineInput {
    /// How far the needle's tip is along the line from the place of entry at rest, in the world.
    pub tip_m: f64,
    /// Only rate terms and relaxation use it.
    pub dt_s: f64,
}

/// One tick. Its work is bounded, it does not allocate, and every finite input gives finite forces. A state of another model
/// is left as it is.
pub fn step(model: &LineModel, state: &mut LineState, input: &LineInput) -> LineOutput {
    if !(input.tip_m.is_finite() && input.dt_s.is_finite() && input.dt_s > 0.0 && state.fits(model)) {
        return LineOutput {
            is_refused: true,
            ..state.last
        };
    }
    let tip_m = input.tip_m.clamp(-FURTHEST_M, FURTHEST_M);
    state.leave_company();
    if state.tip.material_m == f64::NEG_INFINITY {
        state.tip.material_m = tip_m.min(0.0);
    }
    let (rows, common_m_per_n) = (&model.compliance.rows, model.compliance.common_m_per_n());
    state
        .memory
        .begin(rows, common_m_per_n, &model.settings.prony, input.dt_s);
    let mut output = LineOutput::default();
    let mut scratch = Scratch::new();
    for _ in 0..MAX_PASSES {
        let front = model.front(&state.tip);
        touch(model, state, tip_m, &mut scratch);
        press(model, state, front.membrane);
        let gap_m = solve(
            model,
            state,
            tip_m,
            front.limit_n,
            input.dt_s,
            (&mut scratch, &mut output),
        );
        output.held_by = front.membrane;
        let is_pushed = state.tip.force_n >= front.limit_n;
        if let (Some(layer), true) = (front.membrane, state.tip.force_n > 0.0) {
            let pushed_m = tip_m - gap_m - state.tip.material_m - state.tip.met_u_m;
            if is_pushed || pushed_m >= model.layers[layer].puncture_depth_m {
                state.tip.opened |= 1 << layer;
                output.punctured = output.punctured.or(Some(layer));
                continue;
            }
        }
        let goes_on = gap_m > CLOSED_M && is_pushed && front.membrane.is_none();
        let goes_back = gap_m < -CLOSED_M && state.tip.force_n <= 0.0;
        if !(goes_on || goes_back) || !follow(model, state, tip_m, gap_m, front.to_m) {
            break;
        }
    }
    slip(model, state, tip_m);
    finish(model, state, &mut output);
    output
}

/// Stations that reached their friction stick to where they are now.
pub(super) fn slip(model: &LineModel, state: &mut LineState, tip_m: f64) {
    for n in 0..state.in_contact {
        if state.shaft_n[n].abs() >= limit_n(model, state.tip.material_m, n) {
            state.anchor_m[n] = tip_m - state.u_m[n];
        }
    }
}

/// [`touch`] for a tick beside other needles.
pub(super) fn touch_beside(model: &LineModel, state: &mut LineState, tip_m: f64) {
    touch(model, state, tip_m, &mut Scratch::new());
}

/// Which stations the shaft touches, and where the tip loads. A station that is new sticks to where it is.
fn touch(model: &LineModel, state: &mut LineState, tip_m: f64, scratch: &mut Scratch) {
    let c = &model.compliance;
    let depth = state.tip.material_m / c.spacing_m;
    let now = if depth > 0.0 {
        (depth.ceil() as usize).min(c.stations)
    } else {
        0
    };
    let before = state.in_contact;
    if now < before {
        state.shaft_n[now..before].fill(0.0);
    }
    state.in_contact = now;
    state.tip_range = model.tip_weights(state.tip.material_m, &mut state.tip_weights);
    if state.tip_range.is_empty() {
        state.tip.force_n = 0.0;
    }
    let m = c.stations;
    let column = &mut state.tip_column[..now];
    column.fill(0.0);
    state.tip_own = 0.0;
    for (n, &weight) in state.tip_range.clone().zip(&state.tip_weights) {
        let row = c.rows.row(m + n);
        add_scaled(weight, &row[..now], column);
        let tips = row[m..].iter().skip(state.tip_range.start).zip(&state.tip_weights);
        state.tip_own += weight * tips.take(state.tip_range.len()).map(|(r, w)| r * w).sum::<f64>();
    }
    let (gain, force_n) = (state.memory.gain, state.tip.force_n);
    scratch.count = now;
    if model.settings.by_sets {
        sets::displacement(model.simd, &c.rows, &state.shaft_n, scratch);
    }
    for ((n, &of_tip), &of_shaft) in column.iter().enumerate().zip(scratch.u_m.numbers()) {
        let of_shaft = if model.settings.by_sets {
            of_shaft
        } else {
            dot(&c.rows.row(n)[..now], &state.shaft_n[..now])
        };
        state.u_m[n] = gain * (of_shaft + of_tip * force_n) + state.memory.offset_m[n];
        if n >= before {
            state.anchor_m[n] = tip_m - state.u_m[n];
        }
    }
}

/// A membrane is stiffer than what it holds: between the place of the tip and the body as a whole it is a spring, of such a
/// stiffness that both of its limits, force and depth, are met at once (eq. 10). It is relaxed when the tip meets it. Returns what it leaves of the dent, where one holds the tip.
pub(super) fn press(model: &LineModel, state: &mut LineState, membrane: Option<usize>) -> Option<f64> {
    let whole = model.compliance.common_m_per_n();
    let count = state.in_contact;
    let held_by = membrane.map_or(0, |n| n as u32 + 1);
    if held_by != state.tip.held_by {
        let load_n = state.shaft_n[..count].iter().sum::<f64>() + state.tip.force_n;
        state.tip.met_u_m = if held_by == 0 { 0.0 } else { state.tip_u_m };
        state.tip.met_dent_m = if held_by == 0 {
            0.0
        } else {
            state.tip_u_m - whole_m(state, whole, load_n) - state.beside_whole_m
        };
        state.tip.held_by = held_by;
    }
    (state.tip_offset_m, state.membrane_n_per_m) = (0.0, 0.0);
    let kept = membrane.and_then(|n| model.kept_of_dent(n, state.tip_own))?;
    state.membrane_n_per_m = (1.0 / kept - 1.0) / (state.tip_own - whole);
    // Tissue that gives way within the tick leaves the spring more of the dent.
    let gain = state.memory.gain;
    let kept = if gain == 1.0 {
        kept
    } else {
        kept / (kept + gain * (1.0 - kept))
    };
    state.tip_own = whole + kept * (state.tip_own - whole);
    for of_tip in &mut state.tip_column[..count] {
        *of_tip = whole + kept * (*of_tip - whole);
    }
    state.tip_offset_m = (1.0 - kept) * state.tip.met_dent_m;
    if state.memory.is_on() {
        // Of the dent that the past leaves, the spring leaves that part as well.
        state.tip_offset_m -= (1.0 - kept) * (past_at_tip_m(model, state) - state.memory.whole_offset_m);
    }
    Some(kept)
}

/// Displacement of the material at the tip that the past leaves.
fn past_at_tip_m(model: &LineModel, state: &LineState) -> f64 {
    let places = state.tip_range.clone().zip(state.tip_weights);
    places
        .map(|(n, w)| w * state.memory.offset_m[model.compliance.stations + n])
        .sum()
}

/// How far loads of that sum displace the body as a whole, with what the past leaves.
fn whole_m(state: &LineState, whole_m_per_n: f64, load_n: f64) -> f64 {
    if state.memory.is_on() {
        state.memory.gain * whole_m_per_n * load_n + state.memory.whole_offset_m
    } else {
        whole_m_per_n * load_n
    }
}

/// Friction that each station can have, by how much of it the shaft is in.
#[inline]
pub(super) fn limit_n(model: &LineModel, place_m: f64, n: usize) -> f64 {
    let ds = model.compliance.spacing_m;
    model.friction_n_per_m[n] * (place_m - n as f64 * ds).clamp(0.0, ds)
}

/// Forces of shaft and tip; returns how far the tip is beyond where the material has it.
fn solve(
    model: &LineModel,
    state: &mut LineState,
    tip_m: f64,
    tip_limit_n: f64,
    dt_s: f64,
    (scratch, output): (&mut Scratch, &mut LineOutput),
) -> f64 {
    let gain = state.memory.gain;
    let place_m = state.tip.material_m;
    let offset_m = past_at_tip_m(model, state);
    let of_shaft = dot(&state.tip_column, &state.shaft_n[..state.in_contact]);
    state.tip_u_m = gain * (of_shaft + state.tip_own * state.tip.force_n) + (offset_m + state.tip_offset_m);
    let rate = model.settings.viscous_n_s_per_m2 / dt_s;
    if rate != 0.0 || !model.settings.by_sets || !solve_by_sets(model, state, tip_m, tip_limit_n, scratch, output) {
        solve_by_sweeps(model.simd, model, state, tip_m, tip_limit_n, rate, output);
    }
    tip_m - place_m - state.tip_u_m
}

/// Returns whether that found the forces; if not, the state is one to go on from.
fn solve_by_sets(
    model: &LineModel,
    state: &mut LineState,
    tip_m: f64,
    tip_limit_n: f64,
    scratch: &mut Scratch,
    output: &mut LineOutput,
) -> bool {
    let count = state.in_contact;
    let place_m = state.tip.material_m;
    (scratch.count, scratch.gain) = (count, state.memory.gain);
    scratch.tolerance_m = model.settings.tolerance_m;
    scratch
        .stuck_m
        .set(count, state.anchor_m.iter().map(|anchor| tip_m - anchor));
    scratch
        .limit_n
        .set(count, (0..count).map(|n| limit_n(model, place_m, n)));
    scratch.column.set(count, state.tip_column.iter().copied());
    scratch.force_n.set(count, state.shaft_n.iter().copied());
    scratch.u_m.set(count, state.u_m.iter().copied());
    scratch.tip = Tip {
        own_m_per_n: state.tip_own,
        stuck_m: tip_m - place_m,
        limit_n: tip_limit_n,
        force_n: state.tip.force_n,
        u_m: state.tip_u_m,
        ..Tip::default()
    };
    scratch.products = 0;
    let is_found = sets::find(model.simd, &model.compliance.rows, scratch);
    let found = scratch.force_n.numbers().iter().zip(scratch.limit_n.numbers());
    for (to, (force, &limit)) in state.shaft_n[..count].iter_mut().zip(found) {
        *to = force.max(-limit).min(limit);
    }
    state.u_m[..count].copy_from_slice(&scratch.u_m.numbers()[..count]);
    state.tip.force_n = scratch.tip.force_n.max(0.0).min(tip_limit_n);
    state.tip_u_m = scratch.tip.u_m;
    output.sweeps += scratch.products;
    output.residual_m = scratch.residual_m;
    is_found
}

vectorised! {
    /// [`sweep`] for the instructions that the processor has; the same bits with all of them.
    fn solve_by_sweeps(
        model: &LineModel,
        state: &mut LineState,
        tip_m: f64,
        tip_limit_n: f64,
        slowness: f64,
        output: &mut LineOutput,
    ) {
        sweep(model, state, tip_m, tip_limit_n, slowness, output)
    }
}

/// Forces of shaft and tip by projected Gauss-Seidel.
#[inline(always)]
fn sweep(
    model: &LineModel,
    state: &mut LineState,
    tip_m: f64,
    tip_limit_n: f64,
    slowness: f64,
    output: &mut LineOutput,
) {
    let rows = &model.compliance.rows;
    let (count, gain) = (state.in_contact, state.memory.gain);
    let place_m = state.tip.material_m;
    let LineState {
        ref mut shaft_n,
        ref anchor_m,
        ref mut u_m,
        ref tip_column,
        ..
    } = *state;
    let (shaft_n, anchor_m, u_m) = (&mut shaft_n[..count], &anchor_m[..count], &mut u_m[..count]);
    let tip_column = &tip_column[..count];
    let (mut tip_n, mut tip_u_m) = (state.tip.force_n, state.tip_u_m);
    let tip_gain = gain * state.tip_own;
    for sweep in 0..model.settings.sweeps {
        let mut largest_m = 0.0_f64;
        for step in 0..count {
            let n = if sweep % 2 == 0 { count - 1 - step } else { step };
            let row = &rows.row(n)[..count];
            let own = gain * row[n];
            let limit = limit_n(model, place_m, n);
            let free_n = shaft_n[n] + (tip_m - anchor_m[n] - u_m[n]) / own;
            let mut wanted = free_n.clamp(-limit, limit);
            if slowness > 0.0 && wanted != free_n {
                // Beyond the limit by what the slip of this tick adds.
                let drag =
                    slowness * (place_m - n as f64 * model.compliance.spacing_m).clamp(0.0, model.compliance.spacing_m);
                wanted += (free_n - wanted) * drag * own / (1.0 + drag * own);
            }
            let change = wanted - shaft_n[n];
            if change != 0.0 {
                shaft_n[n] = wanted;
                add_scaled(gain * change, row, u_m);
                tip_u_m += gain * change * tip_column[n];
                largest_m = largest_m.max((change * own).abs());
            }
        }
        if tip_gain > 0.0 {
            let wanted = (tip_n + (tip_m - place_m - tip_u_m) / tip_gain).clamp(0.0, tip_limit_n);
            let change = wanted - tip_n;
            if change != 0.0 {
                tip_n = wanted;
                add_scaled(gain * change, tip_column, u_m);
                tip_u_m += tip_gain * change;
                largest_m = largest_m.max((change * tip_gain).abs());
            }
        }
        output.sweeps += 1;
        output.residual_m = largest_m;
        if largest_m <= model.settings.tolerance_m {
            break;
        }
    }
    state.tip.force_n = tip_n;
    state.tip_u_m = tip_u_m;
}

/// What the spring of a membrane that is stretched passes on to the body as a whole.
fn whole_n(model: &LineModel, state: &LineState) -> f64 {
    if state.membrane_n_per_m == 0.0 {
        return 0.0;
    }
    let load_n = state.shaft_n[..state.in_contact].iter().sum::<f64>() + state.tip.force_n;
    let dent_m = state.tip_u_m - whole_m(state, model.compliance.common_m_per_n(), load_n) - state.beside_whole_m;
    state.membrane_n_per_m * (dent_m - state.tip.met_dent_m)
}

pub(super) fn finish(model: &LineModel, state: &mut LineState, output: &mut LineOutput) {
    let m = model.compliance.stations;
    let count = state.in_contact;
    state.whole_n = whole_n(model, state);
    state.loads_n.fill(0.0);
    state.loads_n[..count].copy_from_slice(&state.shaft_n[..count]);
    for (n, weight) in state.tip_range.clone().zip(state.tip_weights) {
        state.loads_n[m + n] = weight * (state.tip.force_n - state.whole_n);
    }
    output.shaft_n = state.shaft_n[..count].iter().sum();
    output.tip_n = state.tip.force_n;
    output.force_on_hand_n = -(output.shaft_n + output.tip_n);
    output.tip_material_m = state.tip.material_m;
    let stretch = |pair: &[f64]| 1.0 + (pair[1] - pair[0]) / model.compliance.spacing_m;
    output.least_stretch = state.u_m[..count].windows(2).map(stretch).fold(1.0, f64::min);
    state.whole_n = state.memory.finish(&mut state.loads_n, state.whole_n);
    state.last = *output;
}

#[cfg(test)]
mod tests;
