//! Dry friction that sticks at zero speed: a set-valued law, solved implicitly in closed form.
//!
//! The tissue holds the shaft at an anchor through a stiff spring. The implicit step of
//! `force in -limit * sgn(anchor speed)` has one solution: the spring's force projected on what friction
//! can hold, with the anchor dragged along by what is left over (Kikuuwe 2006). No velocity enters, so
//! nothing chatters at rest, and an anchor that holds does not drift.

use serde::{Deserialize, Serialize};

/// What friction can hold, on either side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionLimits {
    pub stiffness_n_per_m: f64,
    /// Against motion towards larger positions.
    pub forward_n: f64,
    /// Against motion towards smaller positions.
    pub backward_n: f64,
}

/// Where the shaft is held. `None`: not in touch.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FrictionState {
    pub anchor_m: Option<f64>,
}

impl FrictionState {
    pub fn release(&mut self) {
        self.anchor_m = None;
    }
}

/// Force along the axis on the body at `position_m`, within `-forward_n ..= backward_n`.
///
/// A shaft that comes into touch does so sliding forward, with all of the friction at once.
pub fn friction(limits: &FrictionLimits, state: &mut FrictionState, position_m: f64) -> f64 {
    let (k, forward, backward) = (
        limits.stiffness_n_per_m,
        limits.forward_n.max(0.0),
        limits.backward_n.max(0.0),
    );
    if !position_m.is_finite() || k.is_nan() || k <= 0.0 {
        state.release();
        return 0.0;
    }
    let anchor_m = state.anchor_m.unwrap_or(position_m - forward / k);
    let force_n = (k * (anchor_m - position_m)).max(-forward).min(backward);
    state.anchor_m = Some(position_m + force_n / k);
    force_n
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: FrictionLimits = FrictionLimits {
        stiffness_n_per_m: 700.0,
        forward_n: 2.0,
        backward_n: 1.0,
    };

    fn at_rest(position_m: f64) -> FrictionState {
        FrictionState {
            anchor_m: Some(position_m),
        }
    }

    #[test]
    fn sliding_friction_has_its_full_size_against_the_motion() {
        let mut state = at_rest(0.0);
        let forward = (1..=100)
            .map(|i| friction(&LIMITS, &mut state, f64::from(i) * 1e-4))
            .last();
        assert_eq!(forward, Some(-2.0));
        let backward = (1..=100)
            .map(|i| friction(&LIMITS, &mut state, 0.01 - f64::from(i) * 1e-4))
            .last();
        assert_eq!(backward, Some(1.0));
    }

    #[test]
    fn a_stuck_shaft_is_a_spring_that_forgets_nothing() {
        let mut state = at_rest(0.02);
        for i in 0..100_000 {
            let tremble = 1e-3 * f64::from(i).sin();
            let force = friction(&LIMITS, &mut state, 0.02 + tremble);
            assert!((force + 700.0 * tremble).abs() < 1e-9);
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
            let held = state.anchor_m.unwrap_or(0.0);
            let force = friction(&LIMITS, &mut state, position);
            let slip = state.anchor_m.unwrap_or(0.0) - held;
            assert!(force * slip <= 1e-15, "friction drives the slip");
            work += force * (position - previous);
            previous = position;
        }
        let held_at_most = 2.0 * 2.0 / (2.0 * 700.0);
        assert!(work < held_at_most, "work done on the operator: {work} J");
    }

    #[test]
    fn touch_begins_with_all_of_the_friction() {
        let mut state = FrictionState::default();
        assert!((friction(&LIMITS, &mut state, 0.5) + 2.0).abs() < 1e-9);
        assert_eq!(friction(&LIMITS, &mut state, f64::NAN), 0.0);
        assert_eq!(state.anchor_m, None);
    }
}
