//! The needle as an Euler-Bernoulli beam: how it bends between hand, template hole and the tissue along its shaft.
//!
//! Its flexibility is known in closed form: a beam clamped at the hand, led by the hole of the template. Each station of the shaft is
//! tied to the tissue across the line, both ways, at the place where the tip went through. With the tissue's compliance across the line
//! `W` and the needle's `A`, the forces on the tissue solve `(W + A) f = (needle without tissue) - (track)`, which is
//! positive definite. A rigid needle has no beam and pays nothing.

use super::rows::Rows;

/// Closer than this to the template, the hand's clamp and the hole are one clamp.
const AT_TEMPLATE_M: f64 = 1e-3;

/// A needle and the tissue across its line.
#[derive(Clone, Debug)]
pub struct BeamModel {
    /// E I; 0.016 N m^2 for 18 G steel.
    pub bending_stiffness_n_m2: f64,
    /// From hand to tip.
    pub length_m: f64,
    /// Hole that leads the needle, along the line from the entry (negative: before it).
    pub template_m: Option<f64>,
    /// Distance of stations, m.
    pub spacing_m: f64,
    /// How stations move across the line with forces on each, m/N, along both directions.
    pub across: [Rows; 2],
}

/// Forces across the line and the track that the tip has cut.
#[derive(Clone, Debug, PartialEq)]
pub struct BeamState {
    /// On the tissue, along both directions.
    forces_n: [Vec<f64>; 2],
    /// Where each station's track lies in the tissue at rest, across the line.
    track_m: [Vec<f64>; 2],
    /// Stations that have a track, and that the shaft is in.
    entered: usize,
    in_contact: usize,
    factor: Vec<f64>,
    known: Vec<f64>,
}

/// What holds the needle across the line in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BeamInput {
    /// Tip along the line from the entry.
    pub tip_m: f64,
    /// Where the hand is across the line, and the slope it gives the needle.
    pub hand_m: [f64; 2],
    /// Slope that the hand gives the needle, along both directions.
    pub hand_slope: [f64; 2],
    /// Force on the tip across the line: the bevel's, in proportion to the cutting force.
    pub tip_force_n: [f64; 2],
}

/// The bent needle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BeamOutput {
    /// Of the tip, across the line.
    pub tip_m: [f64; 2],
    /// Of the needle on what clamps it at the hand.
    pub force_on_hand_n: [f64; 2],
    /// The model could not be solved; the needle is taken as straight.
    pub is_refused: bool,
}

impl BeamState {
    /// A straight needle.
    pub fn new(model: &BeamModel) -> Self {
        let m = model.across[0].size();
        let zeros = || vec![0.0; m];
        BeamState {
            forces_n: [zeros(), zeros()],
            track_m: [zeros(), zeros()],
            entered: 0,
            in_contact: 0,
            factor: vec![0.0; m * m],
            known: zeros(),
        }
    }

    /// On the tissue at each station, along direction 0 or 1.
    pub fn forces_n(&self, side: usize) -> &[f64] {
        &self.forces_n[side.min(1)]
    }
}

/// The needle without tissue, in one tick.
struct Beam {
    clamp_m: f64,
    hole_m: Option<f64>,
    stiffness: f64,
}

impl Beam {
    fn new(model: &BeamModel, tip_m: f64) -> Self {
        let hand_m = tip_m - model.length_m;
        let (clamp_m, hole_m) = match model.template_m {
            Some(hole) if hole < hand_m + AT_TEMPLATE_M => (hole.max(hand_m), None),
            Some(hole) if hole < tip_m => (hand_m, Some(hole)),
            _ => (hand_m, None),
        };
        Beam {
            clamp_m,
            hole_m,
            stiffness: model.bending_stiffness_n_m2,
        }
    }

    /// Deflection at one place by a newton at another, clamped and free.
    fn free(&self, a_m: f64, b_m: f64) -> f64 {
        let (x, y) = (
            (a_m.min(b_m) - self.clamp_m).max(0.0),
            (a_m.max(b_m) - self.clamp_m).max(0.0),
        );
        x * x * (3.0 * y - x) / (6.0 * self.stiffness)
    }

    /// The same, led by the hole.
    fn led(&self, a_m: f64, b_m: f64) -> f64 {
        let led = self
            .hole_m
            .map(|t| self.free(a_m, t) * self.free(t, b_m) / self.free(t, t));
        self.free(a_m, b_m) - led.unwrap_or(0.0)
    }

    /// Deflection without tissue: hand and bevel, the hole at 0.
    fn alone(&self, at_m: f64, tip_m: f64, input: &BeamInput, side: usize) -> f64 {
        let straight = |x: f64| input.hand_m[side] + input.hand_slope[side] * (x - self.clamp_m);
        let led = self.hole_m.map(|t| straight(t) * self.free(at_m, t) / self.free(t, t));
        straight(at_m) - led.unwrap_or(0.0) + self.led(at_m, tip_m) * input.tip_force_n[side]
    }
}

/// One tick; does not allocate. Input that is not finite changes nothing.
pub fn step(model: &BeamModel, state: &mut BeamState, input: &BeamInput) -> BeamOutput {
    let numbers = [input.hand_m, input.hand_slope, input.tip_force_n];
    let m = model.across[0].size();
    if !(input.tip_m.is_finite() && numbers.iter().flatten().all(|n| n.is_finite())) || state.known.len() != m {
        return BeamOutput {
            is_refused: true,
            ..BeamOutput::default()
        };
    }
    let beam = Beam::new(model, input.tip_m);
    let ds = model.spacing_m;
    let now = ((input.tip_m / ds + 0.5).floor().max(0.0) as usize).min(m);
    let mut output = BeamOutput::default();
    for side in 0..2 {
        enter(model, state, &beam, input, side, now);
        balance(model, state, &beam, input, side, now);
        let forces = &state.forces_n[side][..now];
        let stations = forces.iter().enumerate().map(|(n, f)| ((n as f64 + 0.5) * ds, f));
        let by_tissue: f64 = stations.clone().map(|(x, f)| beam.led(input.tip_m, x) * f).sum();
        output.tip_m[side] = beam.alone(input.tip_m, input.tip_m, input, side) - by_tissue;
        output.force_on_hand_n[side] = hand(&beam, input, side, stations);
    }
    state.entered = state.entered.max(now);
    state.in_contact = now;
    output
}

/// New stations are tied to the tissue where the needle goes through it now; the shaft has left the others.
fn enter(model: &BeamModel, state: &mut BeamState, beam: &Beam, input: &BeamInput, side: usize, now: usize) {
    let at = |n: usize| (n as f64 + 0.5) * model.spacing_m;
    let forces = &mut state.forces_n[side];
    forces[now..].fill(0.0);
    for n in state.entered..now {
        let moved: f64 = (0..n)
            .map(|k| (beam.led(at(n), at(k)) + model.across[side].row(n)[k]) * forces[k])
            .sum();
        state.track_m[side][n] = beam.alone(at(n), input.tip_m, input, side) - moved;
        forces[n] = 0.0;
    }
}

/// Solves for the forces, by a Cholesky factor.
fn balance(model: &BeamModel, state: &mut BeamState, beam: &Beam, input: &BeamInput, side: usize, now: usize) {
    let at = |n: usize| (n as f64 + 0.5) * model.spacing_m;
    let (factor, known) = (&mut state.factor, &mut state.known[..now]);
    for row in 0..now {
        let (above, this) = factor.split_at_mut(row * now);
        let this = &mut this[..=row];
        for (column, slot) in this.iter_mut().enumerate() {
            *slot = model.across[side].row(row)[column] + beam.led(at(row), at(column));
        }
        for column in 0..row {
            let other = &above[column * now..column * now + column + 1];
            let done = super::rows::dot(&this[..column], &other[..column]);
            // The diagonal holds inverses.
            this[column] = (this[column] - done) * other[column];
        }
        let pivot = this[row] - super::rows::dot(&this[..row], &this[..row]);
        this[row] = if pivot > 0.0 { 1.0 / pivot.sqrt() } else { 0.0 };
        let wanted = beam.alone(at(row), input.tip_m, input, side) - state.track_m[side][row];
        known[row] = (wanted - super::rows::dot(&this[..row], &known[..row])) * this[row];
    }
    for row in (0..now).rev() {
        let value = known[row] * factor[row * now + row];
        known[row] = value;
        for (left, a) in known[..row].iter_mut().zip(&factor[row * now..]) {
            *left -= a * value;
        }
    }
    state.forces_n[side][..now].copy_from_slice(known);
}

/// What the clamp at the hand takes: all forces on the needle less what the hole takes.
fn hand<'a>(
    beam: &Beam,
    input: &BeamInput,
    side: usize,
    stations: impl Iterator<Item = (f64, &'a f64)> + Clone,
) -> f64 {
    let by_tissue: f64 = stations.clone().map(|(_, f)| -f).sum();
    let hole = beam.hole_m.map(|t| {
        let straight = input.hand_m[side] + input.hand_slope[side] * (t - beam.clamp_m);
        let tissue: f64 = stations.map(|(x, f)| beam.free(t, x) * -f).sum();
        -(straight + tissue + beam.free(t, input.tip_m) * input.tip_force_n[side]) / beam.free(t, t)
    });
    by_tissue + input.tip_force_n[side] + hole.unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
