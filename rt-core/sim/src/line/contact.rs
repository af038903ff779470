//! The needle against the tissue on its line, once a tick: Coulomb friction with anchors in the tissue, membranes,
//! cutting.
//!
//! Each station of the shaft sticks to the tissue until the force between them reaches the friction of its length, and
//! slips with that force from then on. The tip pushes, and never pulls: against a membrane up to the force at which it
//! gives way, in tissue up to the cutting force. All at once this is a convex problem with one solution, which is found
//! from that of the last tick by sets of stations that stick (`sets`); by projected Gauss-Seidel where a rate term is
//! on, or where sets go round in a circle. Nothing depends on speed unless a rate term is asked for.

use super::model::LineModel;
use super::rows::{add_scaled, dot};
use super::state::{LineOutput, LineState};
use super::tip::{Place, Tried, follow};
use forces::solve;
pub(super) use forces::{Neighbours, Shaft, find_by_sets, sweep};
pub(super) use membrane::{Spring, meet, press};
use membrane::{past_at_tip_m, whole_n};
use sets::LINE_BLOCKS;

mod forces;
mod membrane;
pub(super) mod sets;

/// Work space for the stations of one line. It is kept from tick to tick: what a tick reads of it, the tick has
/// written.
pub(super) type Scratch = sets::Scratch<LINE_BLOCKS>;

/// Solutions in one tick at most: the tip advances, a membrane gives way, the tip advances again.
const MAX_PASSES: u32 = 12;
/// Gap at the tip below which another pass would be wasted.
const CLOSED_M: f64 = 1e-7;
/// Largest distance from its entry to which a line is followed.
const FURTHEST_M: f64 = 10.0;

/// Position of the needle in one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineInput {
    /// Distance of the needle's tip along the line from the place of entry at rest, in the world.
    pub tip_m: f64,
    /// Period, s; only rate terms and relaxation use it.
    pub dt_s: f64,
}

/// Advances by one tick. Its work is bounded, it does not allocate, and every finite input gives finite forces. A state
/// of another model does not change.
pub fn step(model: &LineModel, state: &mut LineState, input: &LineInput) -> LineOutput {
    step_in(model, state, input, &mut Scratch::new())
}

/// Advances by one tick, in a scratch that other ticks have used.
pub(super) fn step_in(
    model: &LineModel,
    state: &mut LineState,
    input: &LineInput,
    scratch: &mut Scratch,
) -> LineOutput {
    if !(input.tip_m.is_finite() && input.dt_s.is_finite() && input.dt_s > 0.0 && state.fits(model)) {
        return LineOutput {
            is_refused: true,
            ..state.last
        };
    }
    state.forget_others();
    let (rows, common_m_per_n) = (&model.compliance.rows, model.compliance.common_m_per_n());
    state
        .memory
        .begin(rows, common_m_per_n, &model.settings.prony, input.dt_s);
    state.move_from_outside();
    scratch.begin();
    advance(model, state, input, &mut NoOthers(scratch))
}

/// Needles that share a tick with this one, and are solved with it: none, or those that stay in.
pub(super) trait OtherNeedles {
    /// Begins a tick: stations in contact are known; membrane and tip are made ready for [`solve`](Self::solve).
    fn begin(&mut self, model: &LineModel, state: &mut LineState, tip_m: f64, membrane: Option<usize>);
    /// Solves for all forces; returns how far the tip is beyond where the material has it.
    fn solve(
        &mut self,
        model: &LineModel,
        state: &mut LineState,
        input: &LineInput,
        limit_n: f64,
        output: &mut LineOutput,
    ) -> f64;
    /// Called instead of a solution while the moving needle is outside of the tissue.
    fn rest(&mut self) {}
    /// Called once the forces of the tick are found.
    fn end(&mut self) {}
}

struct NoOthers<'a>(&'a mut Scratch);

impl OtherNeedles for NoOthers<'_> {
    fn begin(&mut self, model: &LineModel, state: &mut LineState, tip_m: f64, membrane: Option<usize>) {
        touch(model, state, tip_m, self.0);
        state.move_membrane_from_outside(model);
        meet(model, state, membrane);
        press(model, state, membrane);
        if let Some(spring) = Spring::of(model, state) {
            let passed_n = spring.passed_n(state, past_at_tip_m(model, state));
            spring.relieve(state, passed_n);
        }
    }

    fn solve(
        &mut self,
        model: &LineModel,
        state: &mut LineState,
        input: &LineInput,
        limit_n: f64,
        output: &mut LineOutput,
    ) -> f64 {
        solve(model, state, input.tip_m, limit_n, input.dt_s, (self.0, output))
    }
}

/// Advances a needle, whose memory has begun the tick, with a finite input.
pub(super) fn advance(
    model: &LineModel,
    state: &mut LineState,
    input: &LineInput,
    others: &mut impl OtherNeedles,
) -> LineOutput {
    let tip_m = input.tip_m.clamp(-FURTHEST_M, FURTHEST_M);
    let input = &LineInput { tip_m, ..*input };
    let mut output = LineOutput::default();
    if !has_met(model, state, tip_m) {
        others.rest();
        stay_outside(model, state, &mut output);
        return output;
    }
    let mut tried = Tried::none(&state.tip);
    for _ in 0..MAX_PASSES {
        let front = model.front(&state.tip);
        others.begin(model, state, tip_m, front.membrane);
        let gap_m = others.solve(model, state, input, front.limit_n, &mut output);
        output.held_by = front.membrane;
        let is_pushed = state.tip.force_n >= front.limit_n;
        if let (Some(layer), true) = (front.membrane, state.tip.force_n > 0.0) {
            let pushed_m = tip_m - gap_m - state.tip.material_m - state.tip.met_u_m;
            if is_pushed || pushed_m >= model.layers[layer].puncture_depth_m {
                state.tip.opened |= 1 << layer;
                output.punctured = output.punctured.or(Some(layer));
                tried = Tried::none(&state.tip);
                continue;
            }
        }
        let past_m = tried.past_m(state, &front, gap_m);
        let gap_m = past_m.unwrap_or(gap_m);
        let goes_on = gap_m > CLOSED_M && is_pushed && front.membrane.is_none();
        let is_past = gap_m.abs() > CLOSED_M && past_m.is_some();
        let goes_back = gap_m < -CLOSED_M && state.tip.force_n <= 0.0;
        if goes_back && front.membrane.is_some() && state.tip.draw_back(-gap_m) {
            continue;
        }
        if goes_back && !has_met(model, state, tip_m) {
            break;
        }
        let place = Place {
            material_m: state.tip.material_m,
            gap_m,
        };
        if !(goes_on || goes_back || is_past) || !follow(model, state, tip_m, front.to_m, place, &mut tried) {
            break;
        }
    }
    slip(model, state, tip_m);
    others.end();
    finish(model, state, &mut output);
    output
}

/// Lets stations that reached their friction stick where they are now.
fn slip(model: &LineModel, state: &mut LineState, tip_m: f64) {
    for n in 0..state.in_contact {
        if state.shaft_n[n].abs() >= limit_n(model, state.tip.material_m, n) {
            state.anchor_m[n] = tip_m - state.u_m[n];
        }
    }
}

/// Returns whether the needle is in the tissue or has come to its surface, which the past and other needles have moved.
/// A tip outside is at the hand's place: one that stopped just before the surface is not held there.
fn has_met(model: &LineModel, state: &mut LineState, tip_m: f64) -> bool {
    let is_out = state.in_contact == 0 && state.tip.force_n == 0.0 && state.tip.material_m <= 0.0;
    if !is_out {
        return true;
    }
    let mut weights = [0.0; 64];
    let range = model.tip_weights(0.0, &mut weights);
    let first = model.compliance.stations + range.start;
    let surface_m = dot(
        &state.memory.offset_m[first..first + range.len()],
        &weights[..range.len()],
    );
    state.tip.material_m = (tip_m - surface_m).min(0.0);
    state.tip.material_m >= 0.0
}

/// Advances a needle that has not met the surface.
fn stay_outside(model: &LineModel, state: &mut LineState, output: &mut LineOutput) {
    // No station is touched, so none has to be found where it sticks.
    lay(model, state);
    press(model, state, None);
    state.tip_u_m = 0.0;
    finish(model, state, output);
}

/// Finds the stations that the shaft touches, where the tip loads, and their places. A new station sticks where it is.
fn touch(model: &LineModel, state: &mut LineState, tip_m: f64, scratch: &mut Scratch) {
    let before = lay(model, state);
    stick(model, state, tip_m, before, scratch);
}

/// Computes the places of the stations by the forces of the solution before; those from `before` on stick there.
pub(super) fn stick<const B: usize>(
    model: &LineModel,
    state: &mut LineState,
    tip_m: f64,
    before: usize,
    scratch: &mut sets::Scratch<B>,
) {
    let c = &model.compliance;
    let (gain, force_n) = (state.memory.gain, state.tip.force_n);
    let now = state.in_contact;
    scratch.count = now;
    if model.settings.by_sets {
        sets::displacement(model.simd, &c.rows, &state.shaft_n, scratch);
    }
    for ((n, &of_tip), &of_shaft) in state.tip_column[..now].iter().enumerate().zip(scratch.u_m.numbers()) {
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

/// Finds the stations that the shaft touches, and where the tip loads; returns how many it touched before.
pub(super) fn lay(model: &LineModel, state: &mut LineState) -> usize {
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
    state.tip_column[..now].fill(0.0);
    let missing = c.tip_missing_m_per_n(state.tip_range.clone(), &state.tip_weights);
    state.tip_own = missing;
    for (n, &weight) in state.tip_range.clone().zip(&state.tip_weights) {
        let row = c.rows.row(m + n);
        add_scaled(weight, &row[..now], &mut state.tip_column[..now]);
        let tips = row[m..].iter().skip(state.tip_range.start).zip(&state.tip_weights);
        state.tip_own += weight * tips.take(state.tip_range.len()).map(|(r, w)| r * w).sum::<f64>();
    }
    let tip_m = state.tip.material_m;
    for n in state.near_stations(model) {
        state.tip_column[n] += c.near_m_per_n(missing, tip_m, n, tip_m);
    }
    before
}

/// Returns the friction limit of a station, by how much of it the shaft is in.
#[inline]
pub(super) fn limit_n(model: &LineModel, place_m: f64, n: usize) -> f64 {
    let ds = model.compliance.spacing_m;
    model.friction_n_per_m[n] * (place_m - n as f64 * ds).clamp(0.0, ds)
}

fn finish(model: &LineModel, state: &mut LineState, output: &mut LineOutput) {
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
