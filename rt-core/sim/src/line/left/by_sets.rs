//! Forces of all needles by sets: which elements and stations stick, and which have reached what they can hold.

use super::solve::SKIPPED;
use super::{LeftNeedle, LeftNeedles};
use crate::line::contact::sets::Tip;
use crate::line::contact::{LineInput, Spring, find_by_sets, limit_n};
use crate::line::model::LineModel;
use crate::line::rows::dot;
use crate::line::state::{LineOutput, LineState};

/// Distance of the tip from its place beyond which it will be solved for at another: until then forces are found to so
/// many times the tolerance.
const FAR_M: f64 = 1e-6;
const FAR: f64 = 20.0;

impl LeftNeedles {
    /// Finds the forces over the elements and then the stations of the moving needle. Returns `None` without a
    /// solution: with rate terms and in creeping tissue, where stations give way within the tick and elements do not,
    /// and where sets cycle.
    pub(super) fn solve_by_sets(
        &mut self,
        model: &LineModel,
        state: &mut LineState,
        input: &LineInput,
        tip_limit_n: f64,
        output: &mut LineOutput,
    ) -> Option<f64> {
        let settings = &model.settings;
        let (count, elements, place_m) = (state.in_contact, self.count, state.tip.material_m);
        let is_plain = settings.by_sets && settings.viscous_n_s_per_m2 == 0.0 && !state.memory.is_on();
        if !is_plain || self.all.size() != elements + model.compliance.stations {
            return None;
        }
        let all = elements + count;
        let limits = || (0..count).map(|n| limit_n(model, place_m, n));
        let scratch = &mut *self.scratch;
        (scratch.count, scratch.gain, scratch.products) = (all, 1.0, 0);
        let stuck = self.rest_m[..elements].iter().copied();
        scratch.stuck_m.set(
            all,
            stuck.chain(state.anchor_m[..count].iter().map(|anchor| input.tip_m - anchor)),
        );
        scratch.low_n.set(
            all,
            self.low_n[..elements]
                .iter()
                .copied()
                .chain(limits().map(|limit| -limit)),
        );
        scratch
            .high_n
            .set(all, self.high_n[..elements].iter().copied().chain(limits()));
        scratch
            .column
            .set(all, each(&self.by_tip[..elements], &state.tip_column[..count]));
        let common = std::iter::repeat(model.compliance.common_m_per_n());
        scratch.hold_by(
            Spring::of(model, state),
            self.whole[..elements].iter().copied().chain(common),
        );
        scratch
            .force_n
            .set(all, each(&self.force_n[..elements], &state.shaft_n[..count]));
        scratch.u_m.set(all, each(&self.u_m[..elements], &state.u_m[..count]));
        let by_others = dot(&self.by_tip[..elements], &self.force_n[..elements]);
        let by_own = dot(&state.tip_column[..count], &state.shaft_n[..count]) + state.tip_own * state.tip.force_n;
        scratch.tip = Tip {
            own_m_per_n: state.tip_own,
            stuck_m: input.tip_m - place_m,
            limit_n: tip_limit_n,
            force_n: state.tip.force_n,
            u_m: by_own + state.tip_offset_m + by_others,
            ..Tip::default()
        };
        let inverse = (self.inverse.size() == elements).then_some(&self.inverse);
        scratch.tolerance_m = settings.tolerance_m * FAR;
        let mut is_found = find_by_sets(model.simd, &self.all, inverse, scratch);
        let tip = &scratch.tip;
        let goes_on = tip.force_n >= tip_limit_n && tip.stuck_m - tip.u_m > FAR_M && state.tip.held_by == 0;
        if !(is_found && goes_on) {
            scratch.tolerance_m = settings.tolerance_m;
            is_found = find_by_sets(model.simd, &self.all, inverse, scratch);
        }
        let (forces, moved) = (scratch.force_n.numbers(), scratch.u_m.numbers());
        let mut has_moved = count > 0;
        for (k, force) in forces[..elements].iter().enumerate() {
            let force_n = force.max(self.low_n[k]).min(self.high_n[k]);
            let moved_m = (force_n - self.force_n[k]).abs() * self.own[k * self.stride + k];
            has_moved |= moved_m > SKIPPED * settings.tolerance_m;
            self.force_n[k] = force_n;
        }
        self.u_m[..elements].copy_from_slice(&moved[..elements]);
        for (n, force) in forces[elements..all].iter().enumerate() {
            let limit = limit_n(model, place_m, n);
            state.shaft_n[n] = force.max(-limit).min(limit);
        }
        state.u_m[..count].copy_from_slice(&moved[elements..all]);
        state.tip.force_n = scratch.tip.force_n.max(0.0).min(tip_limit_n);
        state.tip_u_m = scratch.tip.u_m;
        output.sweeps += scratch.products;
        output.residual_m = scratch.residual_m;
        self.is_still = !has_moved && state.tip.force_n == 0.0 && !self.needles.iter().any(LeftNeedle::is_drawn);
        is_found.then_some(input.tip_m - place_m - state.tip_u_m)
    }
}

/// Chains the values of the elements and those of the stations.
fn each<'a>(of_elements: &'a [f64], of_stations: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    of_elements.iter().chain(of_stations).copied()
}
