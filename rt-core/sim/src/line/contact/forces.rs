//! Forces of shaft and tip for a given place of the tip: by sets of sticking stations, or by sweeps.

use super::sets::{self, Tip};
use super::{Scratch, Spring, limit_n, past_at_tip_m};
use crate::line::model::LineModel;
use crate::line::rows::{Rows, add_scaled, dot};
use crate::line::state::{LineOutput, LineState};
use crate::simd::{Simd, vectorised};

/// Solves for the forces of shaft and tip; returns how far the tip is beyond where the material has it.
pub(super) fn solve(
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
        .high_n
        .set(count, (0..count).map(|n| limit_n(model, place_m, n)));
    scratch
        .low_n
        .set(count, (0..count).map(|n| -limit_n(model, place_m, n)));
    scratch.column.set(count, state.tip_column.iter().copied());
    let common = std::iter::repeat(model.compliance.common_m_per_n());
    scratch.hold_by(Spring::of(model, state), common);
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
    let is_found = sets::find(model.simd, &model.compliance.rows, None, scratch);
    let found = scratch.force_n.numbers().iter().zip(scratch.high_n.numbers());
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

/// Calls [`sets::find`] for a tick with other needles.
pub(in crate::line) fn find_by_sets<const B: usize>(
    simd: Simd,
    rows: &Rows,
    inverse: Option<&Rows>,
    scratch: &mut sets::Scratch<B>,
) -> bool {
    sets::find(simd, rows, inverse, scratch)
}

vectorised! {
    /// Calls [`sweep`] for the instructions of the processor; all of them give the same bits.
    fn solve_by_sweeps(
        model: &LineModel,
        state: &mut LineState,
        tip_m: f64,
        tip_limit_n: f64,
        slowness: f64,
        output: &mut LineOutput,
    ) {
        sweep(model, state, (tip_m, tip_limit_n, slowness), &mut (), output)
    }
}

/// The stations of the needle that moves, to its neighbours.
pub(in crate::line) struct Shaft<'a> {
    pub u_m: &'a mut [f64],
    /// Displacement of each station by the tip's force.
    pub column: &'a [f64],
    pub spring: Option<Spring>,
}

/// Needles whose forces are swept together with those of this one: none, or those that stay in.
pub(in crate::line) trait Neighbours {
    /// Called when the force of a station of the shaft has changed; dents of as much take `taken_n` from those of the
    /// neighbours.
    fn shaft_changed(&mut self, n: usize, change_n: f64, taken_n: f64);
    /// Called when the force of the tip has changed.
    fn tip_changed(&mut self, change_n: f64);
    /// Corrects its own forces, and adds what that moves of the stations and the tip; returns the largest correction.
    fn sweep(&mut self, is_backwards: bool, shaft: Shaft<'_>, tip_u_m: &mut f64) -> f64;
}

impl Neighbours for () {
    #[inline(always)]
    fn shaft_changed(&mut self, _n: usize, _change_n: f64, _taken_n: f64) {}
    #[inline(always)]
    fn tip_changed(&mut self, _change_n: f64) {}
    #[inline(always)]
    fn sweep(&mut self, _is_backwards: bool, _shaft: Shaft<'_>, _tip_u_m: &mut f64) -> f64 {
        0.0
    }
}

/// Finds the forces of shaft, tip and neighbours by projected Gauss-Seidel. Slowness is a rate term over the time of a
/// tick.
#[inline(always)]
pub(in crate::line) fn sweep(
    model: &LineModel,
    state: &mut LineState,
    (tip_m, tip_limit_n, slowness): (f64, f64, f64),
    neighbours: &mut impl Neighbours,
    output: &mut LineOutput,
) {
    let rows = &model.compliance.rows;
    let (count, gain) = (state.in_contact, state.memory.gain);
    let place_m = state.tip.material_m;
    let spring = Spring::of(model, state);
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
        let is_backwards = sweep % 2 == 0;
        let mut largest_m = 0.0_f64;
        for step in 0..count {
            let n = if is_backwards { count - 1 - step } else { step };
            let row = &rows.row(n)[..count];
            let dent = spring.map_or(0.0, |spring| tip_column[n] - spring.common_m_per_n);
            let taken = spring.map_or(0.0, |spring| spring.n_per_m * dent);
            let own = gain * (row[n] - taken * dent);
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
                if let Some(spring) = spring {
                    for (u, of_tip) in u_m.iter_mut().zip(tip_column) {
                        *u -= gain * change * taken * (of_tip - spring.common_m_per_n);
                    }
                }
                neighbours.shaft_changed(n, change, change * taken);
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
                neighbours.tip_changed(change);
                largest_m = largest_m.max((change * tip_gain).abs());
            }
        }
        let shaft = Shaft {
            u_m: &mut *u_m,
            column: tip_column,
            spring,
        };
        largest_m = largest_m.max(neighbours.sweep(is_backwards, shaft, &mut tip_u_m));
        output.sweeps += 1;
        output.residual_m = largest_m;
        if largest_m <= model.settings.tolerance_m {
            break;
        }
    }
    state.tip.force_n = tip_n;
    state.tip_u_m = tip_u_m;
}
