//! Dry friction that sticks at zero speed: a set-valued law, solved implicitly in closed form.
//!
//! The tissue holds the shaft at an anchor through a spring. The implicit step of `force in -limit * sgn(anchor speed)`
//! has one solution: the spring's force projected on what friction can hold, with the anchor dragged along by what is
//! left over (Kikuuwe 2006). A damper in parallel to the spring takes the energy that sampling would otherwise leak
//! into a stuck shaft; the two together never pass the limit.

use serde::{Deserialize, Serialize};

/// Slip after which a softened shaft has its full stiffness again: at the limit a stiffer spring holds less energy.
const RESTORE_M: f64 = 0.02;

/// Largest friction on either side, with stiffness and damping below it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionLimits {
    /// Spring between shaft and anchor, N/m.
    pub stiffness_n_per_m: f64,
    /// Damper in parallel to it, N s/m.
    pub damping_n_s_per_m: f64,
    /// Against motion towards larger positions.
    pub forward_n: f64,
    /// Against motion towards smaller positions.
    pub backward_n: f64,
}

/// Place where the tissue holds the shaft. `None`: not in touch.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FrictionState {
    /// Place of the anchor along the axis, m.
    pub anchor_m: Option<f64>,
    /// Part of the stiffness that the loop has been able to hold, in 0..=1.
    pub softness: f64,
    /// Force of the spring, without the damper.
    pub elastic_n: f64,
}

impl Default for FrictionState {
    fn default() -> Self {
        Self {
            anchor_m: None,
            softness: 1.0,
            elastic_n: 0.0,
        }
    }
}

impl FrictionState {
    /// Ends the contact; the next one begins with the full stiffness again.
    pub fn release(&mut self) {
        *self = Self::default();
    }

    /// Softens the spring where the loop shakes, or gives energy to the hand: a softer spring at the same anchor holds
    /// less of it. Down to `floor`, a part of the full stiffness. Slip brings the stiffness back.
    pub fn soften(&mut self, by: f64, floor: f64) {
        self.softness = (self.softness * by).max(floor.clamp(0.0, 1.0));
    }

    /// Returns the energy in the spring, at most what it can give back.
    pub fn stored_j(&self, limits: &FrictionLimits) -> f64 {
        0.5 * self.elastic_n * self.elastic_n / (limits.stiffness_n_per_m * self.softness).max(1.0)
    }
}

/// Returns the force along the axis on the body at `position_m` that moves with `speed_m_per_s`, within `-forward_n ..=
/// backward_n`.
///
/// A shaft that comes into touch does so sliding forward, with all of the friction at once.
pub fn friction(limits: &FrictionLimits, state: &mut FrictionState, position_m: f64, speed_m_per_s: f64) -> f64 {
    let (k, forward, backward) = (
        limits.stiffness_n_per_m * state.softness,
        limits.forward_n.max(0.0),
        limits.backward_n.max(0.0),
    );
    if !position_m.is_finite() || k.is_nan() || k <= 0.0 {
        state.release();
        return 0.0;
    }
    let anchor_m = state.anchor_m.unwrap_or(position_m - forward / k);
    let stuck_n = k * (anchor_m - position_m);
    state.elastic_n = stuck_n.max(-forward).min(backward);
    let slip_m = (stuck_n - state.elastic_n).abs() / k;
    state.softness = (state.softness + slip_m / RESTORE_M).min(1.0);
    state.anchor_m = Some(position_m + state.elastic_n / k);
    (state.elastic_n - limits.damping_n_s_per_m * speed_m_per_s).clamp(-forward, backward)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: FrictionLimits = FrictionLimits {
        stiffness_n_per_m: 6000.0,
        damping_n_s_per_m: 10.0,
        forward_n: 2.0,
        backward_n: 1.0,
    };

    fn at_rest(position_m: f64) -> FrictionState {
        FrictionState {
            anchor_m: Some(position_m),
            ..FrictionState::default()
        }
    }

    #[test]
    fn sliding_friction_has_its_full_size_against_the_motion() {
        let mut state = at_rest(0.0);
        let forward = (1..=100)
            .map(|i| friction(&LIMITS, &mut state, f64::from(i) * 1e-4, 0.1))
            .last();
        assert_eq!(forward, Some(-2.0));
        let backward = (1..=100)
            .map(|i| friction(&LIMITS, &mut state, 0.01 - f64::from(i) * 1e-4, -0.1))
            .last();
        assert_eq!(backward, Some(1.0));
    }

    #[test]
    fn a_stuck_shaft_is_a_spring_and_a_damper_that_forget_nothing() {
        let mut state = at_rest(0.02);
        for i in 0..100_000 {
            let (tremble, speed) = (1e-4 * f64::from(i).sin(), 1e-3 * f64::from(i).cos());
            let force = friction(&LIMITS, &mut state, 0.02 + tremble, speed);
            assert!((force + 6000.0 * tremble + 10.0 * speed).abs() < 1e-9);
        }
        assert!((state.anchor_m.unwrap() - 0.02).abs() < 1e-12, "the anchor drifts");
    }

    #[test]
    fn friction_never_gives_back_more_than_its_spring_held() {
        let mut state = at_rest(0.0);
        let (mut previous, mut work) = (0.0, 0.0);
        for i in 0..200_000 {
            let t = f64::from(i) * 1e-3;
            let position = 0.01 * (1.3 * t).sin() + 0.003 * (17.0 * t).sin();
            let speed = (position - previous) / 1e-3;
            let held = state.anchor_m.unwrap_or(0.0);
            let force = friction(&LIMITS, &mut state, position, speed);
            let slip = state.anchor_m.unwrap_or(0.0) - held;
            assert!(state.elastic_n * slip <= 1e-15, "friction drives the slip");
            work += force * (position - previous);
            previous = position;
        }
        let held_at_most = 2.0 * 2.0 / (2.0 * 6000.0);
        assert!(work < held_at_most, "work done on the operator: {work} J");
    }

    #[test]
    fn softening_takes_energy_out_of_a_stuck_shaft() {
        let mut state = at_rest(0.0);
        let full = friction(&LIMITS, &mut state, 1e-4, 0.0);
        let mut stored = state.stored_j(&LIMITS);
        for _ in 0..100 {
            state.soften(0.9, 1.0 / 3.0);
            friction(&LIMITS, &mut state, 1e-4, 0.0);
            assert!(state.stored_j(&LIMITS) <= stored);
            stored = state.stored_j(&LIMITS);
        }
        assert!(
            (state.elastic_n - full / 3.0).abs() < 1e-9,
            "down to the floor and no further"
        );
    }

    #[test]
    fn touch_begins_with_all_of_the_friction() {
        let mut state = FrictionState::default();
        assert!((friction(&LIMITS, &mut state, 0.5, 0.0) + 2.0).abs() < 1e-9);
        assert_eq!(friction(&LIMITS, &mut state, f64::NAN, 0.0), 0.0);
        assert_eq!(state.anchor_m, None);
    }
}
