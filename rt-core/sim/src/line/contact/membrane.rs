//! A membrane that holds the tip: a spring between the tip and the body as a whole, which relieves the tissue around.

use crate::line::model::LineModel;
use crate::line::rows::dot;
use crate::line::state::{LineState, TipState};

/// Meets a membrane at the present place of the tissue: past loads and other needles may have moved it before the tip
/// arrived.
pub(in crate::line) fn meet(model: &LineModel, state: &mut LineState, membrane: Option<usize>) {
    let held_by = membrane.map_or(0, |n| n as u32 + 1);
    if held_by == state.tip.held_by || held_by == 0 {
        return;
    }
    let count = state.in_contact;
    let own = dot(&state.tip_column[..count], &state.shaft_n[..count]) + state.tip_own * state.tip.force_n;
    state.tip_u_m = state.memory.gain * own + past_at_tip_m(model, state);
}

/// Presses the membrane: it is stiffer than what it holds, so it is a spring between the tip's place and the body as a
/// whole. Its stiffness is such that both of its limits, force and depth, are met at once (eq. 10). It is relaxed when
/// the tip meets it. Returns the share of the dent that it leaves, where one holds the tip.
pub(in crate::line) fn press(model: &LineModel, state: &mut LineState, membrane: Option<usize>) -> Option<f64> {
    let whole = model.compliance.common_m_per_n();
    let count = state.in_contact;
    let held_by = membrane.map_or(0, |n| n as u32 + 1);
    let near = model
        .compliance
        .tip_missing_m_per_n(state.tip_range.clone(), &state.tip_weights);
    let kept = membrane.and_then(|n| model.kept_of_dent(n, state.tip_own - near));
    // A membrane that is stiffer than the tissue spreads the load over the patch, and no tissue is dented more
    // narrowly.
    let near = if kept.is_some_and(|kept| kept < 1.0) { near } else { 0.0 };
    let near_m = state.near_m(model);
    let is_met = held_by != state.tip.held_by;
    if is_met {
        let load_n = state.shaft_n[..count].iter().sum::<f64>() + state.tip.force_n;
        state.tip.met_u_m = if held_by == 0 { 0.0 } else { state.tip_u_m };
        state.tip.ahead_m = if near > 0.0 { near_m } else { 0.0 };
        state.tip.met_dent_m = if held_by == 0 {
            0.0
        } else {
            state.tip_u_m - whole_m(state, whole, load_n) - state.beside_whole_m - state.tip.ahead_m
        };
        state.tip.held_by = held_by;
    }
    (state.tip_offset_m, state.membrane_n_per_m) = (0.0, 0.0);
    let kept = kept?;
    state.tip_own -= near;
    // Nor is the shaft near it moved; it is where it was when the tip met the membrane.
    for n in state.near_stations(model) {
        let near = model
            .compliance
            .near_m_per_n(near, state.tip.material_m, n, state.tip.material_m);
        let less_m = state.memory.gain * near * state.tip.force_n;
        state.tip_column[n] -= near;
        state.u_m[n] -= less_m;
        state.anchor_m[n] += if is_met { less_m } else { 0.0 };
    }
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
    state.tip_offset_m = (1.0 - kept) * state.tip.met_dent_m + state.tip.ahead_m;
    if state.memory.is_on() {
        // The spring leaves the same share of the dent by past loads.
        state.tip_offset_m -=
            (1.0 - kept) * (past_at_tip_m(model, state) - state.memory.whole_offset_m - state.outside.at_tip_m);
    }
    Some(kept)
}

/// Returns the displacement of the material at the tip that the past leaves.
pub(super) fn past_at_tip_m(model: &LineModel, state: &LineState) -> f64 {
    let places = state.tip_range.clone().zip(state.tip_weights);
    places
        .map(|(n, w)| w * state.memory.offset_m[model.compliance.stations + n])
        .sum()
}

/// Returns the displacement of the body as a whole by loads of that sum, with what the past leaves.
fn whole_m(state: &LineState, whole_m_per_n: f64, load_n: f64) -> f64 {
    if state.memory.is_on() {
        state.memory.gain * whole_m_per_n * load_n + state.memory.whole_offset_m
    } else {
        whole_m_per_n * load_n
    }
}

/// Returns the force that the spring of a stretched membrane passes on to the body as a whole.
pub(super) fn whole_n(model: &LineModel, state: &LineState) -> f64 {
    if state.membrane_n_per_m == 0.0 {
        return 0.0;
    }
    let load_n = state.shaft_n[..state.in_contact].iter().sum::<f64>() + state.tip.force_n;
    let moved_m = state.tip_u_m - state.tip.ahead_m;
    let dent_m = moved_m - whole_m(state, model.compliance.common_m_per_n(), load_n) - state.beside_whole_m;
    state.membrane_n_per_m * (dent_m - state.tip.met_dent_m)
}

/// The membrane's spring as the stations meet it. It passes a part of what dents the tissue at the tip to the body as a
/// whole, so it takes from each place `e s`: `s` is what it passes on, and `e` how much a newton at the tip dents the
/// tissue there.
#[derive(Clone, Copy, Debug)]
pub(in crate::line) struct Spring {
    /// Force that the remaining dents `e'` take from each other: `n_per_m e' e'`.
    pub n_per_m: f64,
    /// Share of a dent that remains, `e' = kept e`.
    pub kept: f64,
    /// Displacement of all of the line by any force.
    pub common_m_per_n: f64,
    gain: f64,
}

impl Spring {
    /// Returns the spring of the membrane that holds the tip, or `None`.
    pub fn of(model: &LineModel, state: &LineState) -> Option<Self> {
        if state.membrane_n_per_m == 0.0 {
            return None;
        }
        let (gain, common_m_per_n) = (state.memory.gain, model.compliance.common_m_per_n());
        let own_m_per_n = state.tip_own - common_m_per_n;
        let stiffness = gain * state.membrane_n_per_m;
        let kept = 1.0 - stiffness * own_m_per_n;
        Some(Spring {
            n_per_m: stiffness / kept,
            kept,
            common_m_per_n,
            gain,
        })
    }

    /// Returns the force that it passes on under the present forces. `moved_m` is the displacement of the tip by the
    /// past and other needles, as the membrane leaves it.
    pub fn passed_n(&self, state: &LineState, moved_m: f64) -> f64 {
        let count = state.in_contact;
        let shaft = &state.shaft_n[..count];
        let load_n = shaft.iter().sum::<f64>() + state.tip.force_n;
        let own_m = dot(&state.tip_column[..count], shaft) + state.tip_own * state.tip.force_n;
        let dent_m = self.gain * (own_m - self.common_m_per_n * load_n) + moved_m + state.tip_offset_m;
        let dent_m = dent_m - state.tip.ahead_m;
        let past_m = state.memory.whole_offset_m + state.beside_whole_m;
        self.n_per_m * self.kept / self.gain * (dent_m - past_m - state.tip.met_dent_m)
    }

    /// Returns the work of the shaft over the displacements by the dent with which the membrane was met.
    pub fn relaxed_j(&self, state: &LineState) -> f64 {
        let shaft = state.shaft_n.iter().zip(&state.tip_column).take(state.in_contact);
        let dent_j: f64 = shaft.map(|(f, of_tip)| f * (of_tip - self.common_m_per_n)).sum();
        (state.tip_offset_m - state.tip.ahead_m) / (state.tip_own - self.common_m_per_n) * dent_j
    }

    /// Subtracts the spring's share from the stations.
    pub fn relieve(&self, state: &mut LineState, passed_n: f64) {
        let by = self.gain * passed_n / self.kept;
        for (u_m, of_tip) in state.u_m[..state.in_contact].iter_mut().zip(&state.tip_column) {
            *u_m -= by * (of_tip - self.common_m_per_n);
        }
    }
}

impl TipState {
    /// Draws the tip back by `by_m` through what it had dented before it met the membrane; returns whether there was
    /// any. No force is on it there.
    pub(in crate::line) fn draw_back(&mut self, by_m: f64) -> bool {
        let back_m = by_m.min(self.ahead_m);
        self.ahead_m -= back_m;
        self.met_u_m -= back_m;
        back_m > 0.0
    }
}

impl LineState {
    /// Returns the elastic energy, J: half of force times displacement at once, plus what creeping tissue held before
    /// the tick. The displacement at which a membrane is relaxed does not count. Does not allocate.
    pub fn elastic_j(&self, model: &LineModel) -> f64 {
        if self.memory.is_on() {
            let at_once = |(n, f): (usize, &f64)| f * (self.u_m[n] - self.memory.offset_m[n]);
            let shaft_j: f64 = self.shaft_n.iter().enumerate().take(self.in_contact).map(at_once).sum();
            let places = self.tip_range.clone().zip(self.tip_weights);
            let past_m: f64 = places
                .map(|(n, w)| w * self.memory.offset_m[self.shaft_n.len() + n])
                .sum();
            let tip_j = self.tip.force_n * (self.tip_u_m - self.tip_offset_m - past_m);
            let relaxed_j = Spring::of(model, self).map_or(0.0, |spring| spring.relaxed_j(self));
            return 0.5 * (shaft_j + tip_j - relaxed_j) / self.memory.gain + self.memory.held_j;
        }
        let shaft = self.shaft_n.iter().zip(&self.u_m).take(self.in_contact);
        let tip_j = self.tip.force_n * (self.tip_u_m - self.tip.ahead_m);
        let moved_j = 0.5 * (shaft.map(|(f, u)| f * u).sum::<f64>() + tip_j);
        moved_j - 0.5 * (self.whole_n * self.tip.met_dent_m + self.outside_j())
    }
}
