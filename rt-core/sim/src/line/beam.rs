//! The needle as an Euler-Bernoulli beam: how it bends between hand, template hole and the tissue along its shaft.
//!
//! Each station across is tied to the tissue, both ways, at the place where the tip went through. With the tissue's
//! compliance across the line `W` and the needle's `A`, known in closed form, the forces on the tissue solve `(W + A) f
//! = (needle without tissue) - (track)`, which is positive definite. The hole leads the needle where it would lie
//! beyond the hole's play. A rigid needle has no beam and pays nothing.

use super::rows::{Rows, dot};
use serde::{Deserialize, Serialize};

mod needle;

pub use needle::BentNeedle;

/// Stations across at most.
pub const MAX_ACROSS: usize = 32;
/// Closer than this to the template, hand and hole are one.
const AT_TEMPLATE_M: f64 = 1e-3;

/// A needle and the tissue across its line.
#[derive(Clone, Debug)]
pub struct BeamModel {
    /// E I; 0.016 N m^2 for 18 G steel.
    pub bending_stiffness_n_m2: f64,
    /// Distance from hand to tip.
    pub length_m: f64,
    /// Compliance of the hand across the needle, m/N, and against rotation, rad/(N m). 0 is a clamp.
    pub grip: [f64; 2],
    /// Hole that leads the needle, along the line from the entry (negative: before it).
    pub template_m: Option<f64>,
    /// Play of the needle in the hole, to each side.
    pub gap_m: f64,
    /// Distance of stations, m.
    pub spacing_m: f64,
    /// Compliance of the body as a whole on its foundation, m/N: it takes the bevel's reaction. The local displacement
    /// at the tip is left out.
    pub whole_m_per_n: f64,
    /// Displacement of each station across the line by forces on each, m/N, along both directions.
    pub across: [Rows; 2],
}

/// Forces across the line and the track that the tip has cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BeamState {
    /// Forces on the tissue, along both directions.
    forces_n: [[f64; MAX_ACROSS]; 2],
    /// Place of each station's track in the tissue at rest, across the line.
    track_m: [[f64; MAX_ACROSS]; 2],
    /// Displacement of the tissue by the probe at each station, across the line.
    outside_m: [[f64; MAX_ACROSS]; 2],
    /// Stations that the shaft is in. One that it leaves forgets its track: a needle that came back next to its own
    /// track would be bent without work.
    in_contact: u32,
}

/// Room for the solution of one tick; leaves nothing to the next.
#[derive(Clone, Debug)]
pub struct BeamScratch {
    flexibility: Vec<f64>,
    factor: Vec<f64>,
    by_hole: [[f64; MAX_ACROSS]; 2],
}

/// Boundary conditions of the needle across the line in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BeamInput {
    /// Tip along the line from the entry, in the world.
    pub tip_m: f64,
    /// Place of the tip in the material of the line.
    pub material_m: f64,
    /// Position of the hand across the line.
    pub hand_m: [f64; 2],
    /// Slope that the hand gives the needle, along both directions.
    pub hand_slope: [f64; 2],
    /// Force on the tip across the line: the bevel's, in proportion to the cutting force.
    pub tip_force_n: [f64; 2],
}

/// The bent needle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BeamOutput {
    /// The needle, and the forces on it but for those of the tissue.
    pub needle: BentNeedle,
    /// Tip across the line.
    pub tip_m: [f64; 2],
    /// Displacement of the tissue at the tip, across the line.
    pub displacement_m: [f64; 2],
    /// Force of the needle on the hand, across the line.
    pub force_on_hand_n: [f64; 2],
    /// Moment of the same about the tip of a rigid needle in that hand: force times place along the line.
    pub moment_nm: [f64; 2],
    /// Force on the hand along the line: a bent beam slides out of what bends it.
    pub axial_n: f64,
    /// Elastic energy of needle and tissue.
    pub stored_j: f64,
    /// The model could not be solved; the needle is taken as straight.
    pub is_refused: bool,
}

impl BeamModel {
    /// Returns the number of stations across.
    pub fn stations(&self) -> usize {
        self.across[0].size().min(self.across[1].size()).min(MAX_ACROSS)
    }
}

impl BeamState {
    /// Returns the force on the tissue at each station, along direction 0 or 1.
    pub fn forces_n(&self, side: usize) -> &[f64] {
        &self.forces_n[side.min(1)]
    }

    /// Returns where the track of a station would lie across the line without the needle.
    fn lies_m(&self, side: usize, n: usize) -> f64 {
        self.track_m[side][n] + self.outside_m[side][n]
    }

    /// Releases the needle: no tissue holds it across.
    pub(super) fn release(&mut self) {
        if self.in_contact > 0 {
            *self = BeamState::default();
        }
    }

    /// Returns whether the probe moves some tissue across the line.
    pub(super) fn is_moved(&self) -> bool {
        self.outside_m.iter().flatten().any(|m| *m != 0.0)
    }

    /// Moves the tissue at the first so many stations by the probe, along each direction, m.
    pub(super) fn move_from_outside(&mut self, by_m: impl Fn(usize, usize) -> f64, stations: usize) {
        for (side, outside_m) in self.outside_m.iter_mut().enumerate() {
            for (n, slot) in outside_m.iter_mut().enumerate().take(stations) {
                *slot = by_m(side, n);
            }
        }
    }

    /// Its number is one of stations: that of a state that was read from a file may not be.
    pub(super) fn is_whole(&self) -> bool {
        self.in_contact as usize <= MAX_ACROSS
    }
}

impl BeamScratch {
    /// Makes the work space of a model.
    pub fn new(model: &BeamModel) -> Self {
        let m = model.stations();
        BeamScratch {
            flexibility: vec![0.0; m * m],
            factor: vec![0.0; m * m],
            by_hole: [[0.0; MAX_ACROSS]; 2],
        }
    }
}

/// Advances by one tick; does not allocate. Input that is not finite changes nothing.
pub fn step(model: &BeamModel, state: &mut BeamState, scratch: &mut BeamScratch, input: &BeamInput) -> BeamOutput {
    let m = model.stations();
    let numbers = [input.hand_m, input.hand_slope, input.tip_force_n];
    let is_finite = input.tip_m.is_finite() && numbers.iter().flatten().all(|n| n.is_finite());
    if !is_finite || scratch.factor.len() != m * m || model.bending_stiffness_n_m2 <= 0.0 {
        return BeamOutput {
            is_refused: true,
            ..BeamOutput::default()
        };
    }
    let depth = (input.material_m / model.spacing_m + 0.5).floor();
    let now = if depth > 0.0 { (depth as usize).min(m) } else { 0 };
    let tied = now.min(state.in_contact as usize);
    let mut needle = needle_of(model, input);
    for n in 0..tied {
        for k in 0..=n {
            scratch.flexibility[n * tied + k] = needle.flexibility(needle.station_m(n), needle.station_m(k));
        }
    }
    for side in 0..2 {
        state.forces_n[side][tied..].fill(0.0);
        balance(model, state, scratch, &needle, side, tied);
    }
    lead(model, state, scratch, &mut needle, tied);
    for side in 0..2 {
        enter(model, state, &needle, side, now);
    }
    state.in_contact = now as u32;
    answer(model, state, needle, now)
}

fn needle_of(model: &BeamModel, input: &BeamInput) -> BentNeedle {
    // Tissue that follows the tip takes its stations along.
    let along_m = if input.material_m.is_finite() {
        input.tip_m - input.material_m
    } else {
        0.0
    };
    BentNeedle {
        bending_stiffness_n_m2: model.bending_stiffness_n_m2,
        length_m: model.length_m,
        grip: model.grip,
        tip_m: input.tip_m,
        hand_m: input.hand_m,
        hand_slope: input.hand_slope,
        hole_m: model.template_m.unwrap_or(0.0),
        hole_n: [0.0; 2],
        tip_n: input.tip_force_n,
        first_m: 0.5 * model.spacing_m + along_m,
        spacing_m: model.spacing_m,
    }
}

/// Solves for the forces of stations that the shaft was in before, by a Cholesky factor, as if there were no hole; and
/// for what each newton of the hole adds to them.
fn balance(
    model: &BeamModel,
    state: &mut BeamState,
    scratch: &mut BeamScratch,
    needle: &BentNeedle,
    side: usize,
    tied: usize,
) {
    let factor = &mut scratch.factor;
    for row in 0..tied {
        let (above, this) = factor.split_at_mut(row * tied);
        let this = &mut this[..=row];
        let (tissue, beam) = (model.across[side].row(row), &scratch.flexibility[row * tied..]);
        for ((slot, w), a) in this.iter_mut().zip(tissue).zip(beam) {
            *slot = w + a;
        }
        for column in 0..row {
            let other = &above[column * tied..column * tied + column + 1];
            let done = dot(&this[..column], &other[..column]);
            // The diagonal holds inverses.
            this[column] = (this[column] - done) * other[column];
        }
        let pivot = this[row] - dot(&this[..row], &this[..row]);
        this[row] = if pivot > 0.0 { 1.0 / pivot.sqrt() } else { 0.0 };
    }
    let by_whole_m = model.whole_m_per_n * needle.tip_n[side];
    for n in 0..tied {
        let at_m = needle.station_m(n);
        state.forces_n[side][n] = needle.without_tissue_m(side, at_m) - state.lies_m(side, n) + by_whole_m;
        scratch.by_hole[side][n] = needle.flexibility(at_m, needle.hole_m);
    }
    solve(factor, tied, &mut state.forces_n[side]);
    if leads(model, needle) {
        solve(factor, tied, &mut scratch.by_hole[side]);
    }
}

fn solve(factor: &[f64], size: usize, values: &mut [f64]) {
    for row in 0..size {
        let this = &factor[row * size..=row * size + row];
        values[row] = (values[row] - dot(&this[..row], &values[..row])) * this[row];
    }
    for row in (0..size).rev() {
        let value = values[row] * factor[row * size + row];
        values[row] = value;
        for (left, a) in values[..row].iter_mut().zip(&factor[row * size..]) {
            *left -= a * value;
        }
    }
}

/// Returns whether the template stands between hand and tip.
fn leads(model: &BeamModel, needle: &BentNeedle) -> bool {
    model
        .template_m
        .is_some_and(|hole_m| hole_m > needle.hand_along_m() + AT_TEMPLATE_M && hole_m < needle.tip_m)
}

/// Holds the needle at the rim of the template's hole where it would lie beyond the play, on the side that it lies on.
fn lead(model: &BeamModel, state: &mut BeamState, scratch: &BeamScratch, needle: &mut BentNeedle, tied: usize) {
    if !leads(model, needle) {
        return;
    }
    let hole_m = needle.hole_m;
    let lies_m = [0, 1].map(|side| needle.across_m(side, hole_m, &state.forces_n[side][..tied]));
    let off_m = lies_m[0].hypot(lies_m[1]);
    if off_m <= model.gap_m {
        return;
    }
    #[expect(clippy::needless_range_loop, reason = "one index over several arrays")]
    for side in 0..2 {
        let wanted_m = lies_m[side] * (model.gap_m / off_m);
        let by_hole = &scratch.by_hole[side][..tied];
        let of_tissue: f64 = by_hole
            .iter()
            .enumerate()
            .map(|(n, f)| needle.flexibility(hole_m, needle.station_m(n)) * f)
            .sum();
        let own = needle.flexibility(hole_m, hole_m) - of_tissue;
        if own <= 0.0 {
            continue;
        }
        let force_n = (wanted_m - lies_m[side]) / own;
        needle.hole_n[side] = force_n;
        for (f, by) in state.forces_n[side].iter_mut().zip(by_hole) {
            *f += force_n * by;
        }
    }
}

/// Returns the displacement of the tissue at a station, across the line.
fn displacement_m(model: &BeamModel, state: &BeamState, needle: &BentNeedle, side: usize, n: usize) -> f64 {
    let by_needle_m = dot(model.across[side].row(n), &state.forces_n[side]) - model.whole_m_per_n * needle.tip_n[side];
    by_needle_m + state.outside_m[side][n]
}

/// Ties new stations to the tissue where the needle goes through it now, without a force.
fn enter(model: &BeamModel, state: &mut BeamState, needle: &BentNeedle, side: usize, now: usize) {
    for n in state.in_contact as usize..now {
        let lies_m = needle.across_m(side, needle.station_m(n), &state.forces_n[side]);
        state.track_m[side][n] = lies_m - displacement_m(model, state, needle, side, n);
    }
}

fn answer(model: &BeamModel, state: &BeamState, needle: BentNeedle, now: usize) -> BeamOutput {
    let mut output = BeamOutput {
        needle,
        ..BeamOutput::default()
    };
    let (hand_m, ei) = (needle.hand_along_m(), needle.bending_stiffness_n_m2);
    for side in 0..2 {
        let forces = &state.forces_n[side][..now];
        let (hole_n, tip_n) = (needle.hole_n[side], needle.tip_n[side]);
        output.tip_m[side] = needle.across_m(side, needle.tip_m, forces);
        output.displacement_m[side] = match now {
            0 => -model.whole_m_per_n * tip_n,
            _ => displacement_m(model, state, &needle, side, now - 1),
        };
        // Of tissue and hole on the needle: sum, moment about the hand, and what the bevel's force turns by bending.
        let on_needle = forces.iter().enumerate().map(|(n, f)| (needle.station_m(n), -f));
        let (mut sum_n, mut moment_nm, mut turned) = (0.0, 0.0, 0.0);
        for (at_m, force_n) in on_needle.chain([(needle.hole_m, hole_n)]) {
            let x = (at_m - hand_m).max(0.0);
            sum_n += force_n;
            moment_nm += force_n * x;
            turned += force_n * x * (2.0 * needle.length_m - x) / (2.0 * ei);
            output.moment_nm[side] += force_n * (at_m - needle.tip_m);
        }
        output.force_on_hand_n[side] = sum_n + tip_n;
        let slope = needle.hand_slope[side] + needle.grip[1] * (moment_nm + tip_n * needle.length_m);
        output.axial_n -= 0.5 * moment_nm * moment_nm / ei + slope * sum_n + tip_n * turned;
        output.stored_j += stored_j(model, state, &needle, side, now, output.tip_m[side]);
    }
    output
}

fn stored_j(model: &BeamModel, state: &BeamState, needle: &BentNeedle, side: usize, now: usize, tip_m: f64) -> f64 {
    let forces = &state.forces_n[side][..now];
    let bent = |at_m: f64| needle.across_m(side, at_m, forces) - needle.straight_m(side, at_m);
    let each = |(n, f): (usize, &f64)| f * (needle.straight_m(side, needle.station_m(n)) - state.lies_m(side, n));
    let in_tissue: f64 = forces.iter().enumerate().map(each).sum();
    let (tip_n, sum_n) = (needle.tip_n[side], forces.iter().sum::<f64>());
    let by_whole = model.whole_m_per_n * tip_n * (sum_n - tip_n);
    let by_hole = match needle.hole_n[side] {
        0.0 => 0.0,
        hole_n => hole_n * bent(needle.hole_m),
    };
    0.5 * (in_tissue - by_whole + by_hole + tip_n * (tip_m - needle.straight_m(side, needle.tip_m)))
}

#[cfg(test)]
mod tests;
