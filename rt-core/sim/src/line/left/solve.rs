//! One tick of all needles at once, over the stations of the needle that moves, its tip, and the elements of those that
//! stay in: by sets as for a needle alone, or by projected Gauss-Seidel.

use super::{LeftNeedle, LeftNeedles};
use crate::line::contact::{
    LineInput, Neighbours, OtherNeedles, Shaft, Spring, advance, lay, meet, press, step, stick, sweep,
};
use crate::line::model::{LineModel, MAX_STATIONS};
use crate::line::ready::HandLine;
use crate::line::rows::{add_scaled, dot};
use crate::line::state::{LineOutput, LineState};
use crate::simd::{LANES, Simd, vectorised};

/// Distance before the entry at rest at which a needle meets nothing, wherever the others have moved its surface.
const BEFORE_M: f64 = 20e-3;
/// Share of the tolerance below which corrections of a left needle's element are skipped: most of them are.
pub(super) const SKIPPED: f64 = 0.02;

/// Advances the needle on `line`, and those that stay in, by one tick.
pub(super) fn step_beside(left: &mut LeftNeedles, line: &mut HandLine, input: &LineInput) -> LineOutput {
    let (model, state) = (&line.model, &mut line.state);
    let is_idle = left.is_still && state.in_contact == 0 && state.tip.force_n == 0.0 && input.tip_m < -BEFORE_M;
    if left.needles.is_empty() || left.moving != line.generation || is_idle {
        left.step_rest();
        return step(model, state, input);
    }
    if !(input.tip_m.is_finite() && input.dt_s.is_finite() && input.dt_s > 0.0 && state.fits(model)) {
        return LineOutput {
            is_refused: true,
            ..state.last
        };
    }
    left.enter(model, state, input.dt_s);
    advance(model, state, input, left)
}

impl OtherNeedles for LeftNeedles {
    fn begin(&mut self, model: &LineModel, state: &mut LineState, tip_m: f64, membrane: Option<usize>) {
        let before = lay(model, state);
        state.move_membrane_from_outside(model);
        let goes_on = self.extrapolate_stations(model, state, tip_m, before);
        if !goes_on {
            stick(model, state, tip_m, before, &mut self.scratch);
        }
        meet(model, state, membrane);
        let kept = press(model, state, membrane);
        if let Some(kept) = kept.filter(|_| state.memory.is_on()) {
            // The offset by the others does not belong to the past.
            let m = model.compliance.stations;
            let weights = state.tip_range.clone().zip(state.tip_weights);
            let added: f64 = weights.map(|(n, w)| w * self.added_m[m + n]).sum();
            state.tip_offset_m += (1.0 - kept) * added;
        }
        self.reach(model, state, kept);
        if goes_on {
            self.extrapolate_elements(state);
        } else {
            self.displace(Some(state));
        }
        self.taken_n_per_m = 0.0;
        if let Some(spring) = Spring::of(model, state) {
            self.relieve(model, state, &spring);
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
        let found = self.solve_by_sets(model, state, input, limit_n, output);
        self.without_tip.stations = None;
        if found.is_some() && state.tip.held_by == 0 {
            self.keep_without_tip(state);
        }
        let gap_m = found.unwrap_or_else(|| {
            let rate = model.settings.viscous_n_s_per_m2 / input.dt_s;
            self.solve_by_sweeps(model, state, (input.tip_m, limit_n, rate), output)
        });
        self.add_to(state);
        gap_m
    }

    fn rest(&mut self) {
        self.step_rest();
    }

    fn end(&mut self) {
        self.slip();
    }
}

impl LeftNeedles {
    /// Advances them while the moving needle does not reach them.
    fn step_rest(&mut self) {
        self.taken_n_per_m = 0.0;
        if !self.is_still {
            self.displace(None);
            self.solve_alone();
        }
    }

    /// Adds the displacement of the line by them to its offset, on top of what the past leaves there.
    fn enter(&mut self, model: &LineModel, state: &mut LineState, dt_s: f64) {
        let (rows, terms) = (&model.compliance.rows, &model.settings.prony);
        if !terms.iter().any(|term| term.strength > 0.0) {
            state.memory.offset_m.fill(0.0);
        }
        state.memory.begin(rows, model.compliance.common_m_per_n(), terms, dt_s);
        state.move_from_outside();
        state.is_beside = true;
        self.added_m.fill(0.0);
        self.without_tip.stations = None;
        self.scratch.owned = 0;
        self.add_to(state);
    }

    fn add_to(&mut self, state: &mut LineState) {
        let rows = self.moving_rows;
        for (offset, added) in state.memory.offset_m.iter_mut().zip(&mut self.added_m[..rows]) {
            *offset -= *added;
            *added = 0.0;
        }
        let forces_n = &self.force_n[..self.count];
        add_rows(
            self.simd,
            forces_n,
            &self.to_moving,
            2 * MAX_STATIONS,
            &mut self.added_m[..rows],
        );
        for (offset, added) in state.memory.offset_m.iter_mut().zip(&self.added_m[..rows]) {
            *offset += *added;
        }
        state.beside_whole_m = dot(&self.whole[..self.count], &self.force_n[..self.count]) + state.outside.at_tip_m;
    }

    /// Computes the displacement of each element by the tip's force at its present place; a membrane that holds the tip
    /// takes its part of the dent.
    fn reach(&mut self, model: &LineModel, state: &LineState, kept: Option<f64>) {
        let (m, count) = (model.compliance.stations, self.count);
        self.by_tip[..count].fill(0.0);
        for (n, weight) in state.tip_range.clone().zip(state.tip_weights) {
            let first = (m + n) * self.stride;
            add_scaled(
                weight,
                &self.from_moving[first..first + count],
                &mut self.by_tip[..count],
            );
        }
        let is_loaded = !state.tip_range.is_empty();
        if let Some(kept) = kept.filter(|_| is_loaded) {
            for (by_tip, whole) in self.by_tip[..count].iter_mut().zip(&self.whole) {
                *by_tip = whole + kept * (*by_tip - whole);
            }
        }
    }

    /// Subtracts the membrane spring's share from stations and elements; `by_tip` already includes the tip's.
    fn relieve(&mut self, model: &LineModel, state: &mut LineState, spring: &Spring) {
        let count = self.count;
        self.taken_n_per_m = spring.n_per_m;
        let by_others_m = dot(&self.by_tip[..count], &self.force_n[..count]);
        let passed_n = spring.passed_n(state, self.past_m(model, state) + by_others_m);
        spring.relieve(state, passed_n);
        let by = (passed_n - (1.0 - spring.kept) * state.tip.force_n) / spring.kept;
        for (u_m, (by_tip, whole)) in self.u_m[..count].iter_mut().zip(self.by_tip.iter().zip(&self.whole)) {
            *u_m -= by * (by_tip - whole);
        }
    }

    /// Returns the displacement of the tip by the past alone: `by_tip` has that by the others, in which a membrane has
    /// its part.
    fn past_m(&self, model: &LineModel, state: &LineState) -> f64 {
        let m = model.compliance.stations;
        let past = |n: usize| state.memory.offset_m[m + n] - self.added_m[m + n];
        let weights = state.tip_range.clone().zip(state.tip_weights);
        weights.map(|(n, w)| w * past(n)).sum()
    }

    /// Computes the displacement of each element by all present forces; with `moving`, those of the moving needle as
    /// well.
    pub(super) fn displace(&mut self, moving: Option<&LineState>) {
        let (count, stride, simd) = (self.count, self.stride, self.simd);
        let u_m = &mut self.u_m[..count];
        u_m.fill(0.0);
        // Symmetric: its rows are its columns.
        add_rows(simd, &self.force_n[..count], &self.own, stride, u_m);
        let Some(state) = moving else { return };
        add_rows(simd, &state.shaft_n[..state.in_contact], &self.from_moving, stride, u_m);
        add_scaled(state.tip.force_n, &self.by_tip[..count], &mut self.u_m[..count]);
    }

    /// Solves for the elements among themselves.
    pub(super) fn solve_alone(&mut self) {
        let sweeps_and_tolerance = self.needles.first().map(|n| {
            let settings = &n.line.model.settings;
            (settings.sweeps, settings.tolerance_m)
        });
        let Some((sweeps, tolerance_m)) = sweeps_and_tolerance else {
            return;
        };
        let mut has_moved = false;
        for sweep in 0..sweeps {
            let simd = self.simd;
            let largest_m = sweep_alone(simd, self, sweep % 2 == 0, SKIPPED * tolerance_m);
            has_moved |= largest_m > 0.0;
            if largest_m <= tolerance_m {
                break;
            }
        }
        self.slip();
        self.is_still = !has_moved && !self.needles.iter().any(LeftNeedle::is_drawn);
    }

    /// Lets elements that reached their limit hold from their present place.
    fn slip(&mut self) {
        for k in 0..self.count {
            if self.force_n[k] >= self.high_n[k] || (self.low_n[k] < 0.0 && self.force_n[k] <= self.low_n[k]) {
                self.rest_m[k] = self.u_m[k];
            }
        }
    }
}

impl LeftNeedles {
    /// Finds the forces of shaft, tip and all elements by sweeps; returns how far the tip is beyond where the material
    /// has it.
    fn solve_by_sweeps(
        &mut self,
        model: &LineModel,
        state: &mut LineState,
        (tip_m, tip_limit_n, slowness): (f64, f64, f64),
        output: &mut LineOutput,
    ) -> f64 {
        let (elements, gain) = (self.count, state.memory.gain);
        let offset =
            self.past_m(model, state) + state.tip_offset_m + dot(&self.by_tip[..elements], &self.force_n[..elements]);
        let of_shaft = dot(&state.tip_column, &state.shaft_n[..state.in_contact]);
        state.tip_u_m = gain * (of_shaft + state.tip_own * state.tip.force_n) + offset;
        self.is_still = state.in_contact == 0;
        self.skipped_m = SKIPPED * model.settings.tolerance_m;
        sweep_beside(model.simd, model, state, self, tip_m, tip_limit_n, slowness, output);
        self.is_still &= state.tip.force_n == 0.0 && !self.needles.iter().any(LeftNeedle::is_drawn);
        tip_m - state.tip.material_m - state.tip_u_m
    }
}

impl Neighbours for LeftNeedles {
    #[inline(always)]
    fn shaft_changed(&mut self, n: usize, change_n: f64, taken_n: f64) {
        let row = &self.from_moving[n * self.stride..n * self.stride + self.count];
        add_scaled(change_n, row, &mut self.u_m[..self.count]);
        if taken_n != 0.0 {
            take(taken_n, self);
        }
    }

    #[inline(always)]
    fn tip_changed(&mut self, change_n: f64) {
        add_scaled(change_n, &self.by_tip[..self.count], &mut self.u_m[..self.count]);
    }

    #[inline(always)]
    fn sweep(&mut self, is_backwards: bool, shaft: Shaft<'_>, tip_u_m: &mut f64) -> f64 {
        let Shaft { u_m, column, spring } = shaft;
        let mut largest_m = 0.0_f64;
        for step in 0..self.count {
            let k = if is_backwards { self.count - 1 - step } else { step };
            let (change, moved_m) = correct(self, k, self.skipped_m);
            if change != 0.0 {
                let first = k * 2 * MAX_STATIONS;
                add_scaled(change, &self.to_moving[first..first + u_m.len()], u_m);
                *tip_u_m += change * self.by_tip[k];
                if let Some(spring) = spring {
                    let taken_n = change * spring.n_per_m * (self.by_tip[k] - self.whole[k]);
                    for (u, of_tip) in u_m.iter_mut().zip(column) {
                        *u -= taken_n * (of_tip - spring.common_m_per_n);
                    }
                }
                largest_m = largest_m.max(moved_m);
                self.is_still = false;
            }
        }
        largest_m
    }
}

vectorised! {
    /// Adds up rows with that stride, each times its factor.
    fn add_rows(factors: &[f64], rows: &[f64], stride: usize, sum: &mut [f64]) {
        let stride = stride.max(1);
        let (wide, rest) = sum.as_chunks_mut::<{ 4 * LANES }>();
        let (narrow, rest) = rest.as_chunks_mut::<LANES>();
        let mut from = 0;
        for part in wide {
            add_parts(factors, rows, stride, from, part);
            from += part.len();
        }
        for part in narrow {
            add_parts(factors, rows, stride, from, part);
            from += part.len();
        }
        for (row, factor) in rows.chunks(stride).zip(factors) {
            if let Some(row) = row.get(from..) {
                add_scaled(*factor, row, rest);
            }
        }
    }
}

/// Adds a part of the columns, whose sums stay in registers.
#[inline(always)]
fn add_parts<const N: usize>(factors: &[f64], rows: &[f64], stride: usize, from: usize, sum: &mut [f64; N]) {
    let mut held = *sum;
    for (row, factor) in rows.chunks(stride).zip(factors) {
        if let Some(part) = row.get(from..).and_then(<[f64]>::first_chunk::<N>) {
            for n in 0..N {
                held[n] += factor * part[n];
            }
        }
    }
    *sum = held;
}

/// Corrects one element; returns the change of its force, and the displacement of the element by that.
#[inline(always)]
fn correct(left: &mut LeftNeedles, k: usize, skipped_m: f64) -> (f64, f64) {
    let dent = left.by_tip[k] - left.whole[k];
    let taken = left.taken_n_per_m * dent;
    let own = left.own[k * left.stride + k] - taken * dent;
    let free_n = left.force_n[k] + (left.rest_m[k] - left.u_m[k]) / own;
    let change = free_n.clamp(left.low_n[k], left.high_n[k]) - left.force_n[k];
    let moved_m = (change * own).abs();
    if moved_m <= skipped_m {
        return (0.0, 0.0);
    }
    left.force_n[k] += change;
    let (count, stride) = (left.count, left.stride);
    add_scaled(
        change,
        &left.own[k * stride..k * stride + count],
        &mut left.u_m[..count],
    );
    if taken != 0.0 {
        take(change * taken, left);
    }
    (change, moved_m)
}

/// Subtracts from the elements the spring's share of a change of dent.
#[inline(always)]
fn take(taken_n: f64, left: &mut LeftNeedles) {
    let count = left.count;
    for (u_m, (by_tip, whole)) in left.u_m[..count].iter_mut().zip(left.by_tip.iter().zip(&left.whole)) {
        *u_m -= taken_n * (by_tip - whole);
    }
}

vectorised! {
    fn sweep_alone(left: &mut LeftNeedles, is_backwards: bool, skipped_m: f64) -> f64 {
        let mut largest_m = 0.0_f64;
        for n in 0..left.count {
            let k = if is_backwards { left.count - 1 - n } else { n };
            largest_m = largest_m.max(correct(left, k, skipped_m).1);
        }
        largest_m
    }
}

vectorised! {
    /// Calls [`sweep`] with needles that stay in, for the instructions of the processor; all of them give the same
    /// bits.
    #[expect(clippy::too_many_arguments, reason = "those of `sweep`, and the instructions")]
    fn sweep_beside(
        model: &LineModel,
        state: &mut LineState,
        left: &mut LeftNeedles,
        tip_m: f64,
        tip_limit_n: f64,
        slowness: f64,
        output: &mut LineOutput,
    ) {
        sweep(model, state, (tip_m, tip_limit_n, slowness), left, output)
    }
}
