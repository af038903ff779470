//! Detection of a shaking tip: turns that follow each other faster than deliberate ones.
//!
//! A loop whose link is later than it should be shakes a stuck shaft between its limits. No energy account shows it
//! at once, since the lateness is not known; the turns do.

use serde::{Deserialize, Serialize};

/// Time within which a turn follows the last one to count: a swing of 9 Hz. The tremor of a hand lies at 8 to 12 Hz,
/// but its swings against a stuck shaft are shorter than what counts.
const QUICK_S: f64 = 0.055;
/// Quick turns in a row that count as a shake: one and a half swings.
const TURNS: u32 = 3;
/// Encoder steps of the way back that makes a turn.
const STEPS: f64 = 1.5;

/// Turns of one tip along its path.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ChatterState {
    /// Farthest place since the last turn; `None` before the first sample.
    extreme_m: Option<f64>,
    backwards: bool,
    since_turn_s: f64,
    quick_turns: u32,
}

impl ChatterState {
    /// Takes the position of `dt_s` after the last one; true in each tick with a turn of a shake.
    pub fn shakes(&mut self, position_m: f64, position_step_m: f64, dt_s: f64) -> bool {
        let extreme_m = *self.extreme_m.get_or_insert(position_m);
        self.since_turn_s += dt_s;
        let sign = if self.backwards { -1.0 } else { 1.0 };
        let ahead_m = (position_m - extreme_m) * sign;
        if ahead_m >= 0.0 {
            self.extreme_m = Some(position_m);
            return false;
        }
        if ahead_m > -STEPS * position_step_m {
            return false;
        }
        self.quick_turns = if self.since_turn_s < QUICK_S {
            self.quick_turns.saturating_add(1)
        } else {
            0
        };
        self.backwards = !self.backwards;
        self.extreme_m = Some(position_m);
        self.since_turn_s = 0.0;
        self.quick_turns >= TURNS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns of a shake in two seconds.
    fn turns(hertz: f64, amplitude_m: f64) -> usize {
        let mut state = ChatterState::default();
        (0..2000)
            .filter(|i| {
                let x = amplitude_m * (std::f64::consts::TAU * hertz * f64::from(*i) * 1e-3).sin();
                state.shakes((x / 3e-5).round() * 3e-5, 3e-5, 1e-3)
            })
            .count()
    }

    #[test]
    fn a_shake_is_seen_and_what_a_hand_means_to_do_is_not() {
        let seen = turns(20.0, 2e-4);
        assert!((70..80).contains(&seen), "{seen} turns of 80");
        assert_eq!(turns(8.0, 3e-4), 0, "a hand that trembles");
        assert_eq!(turns(20.0, 1.4e-5), 0, "flicker of the encoder");
        let mut state = ChatterState::default();
        assert!(!state.shakes(f64::NAN, 3e-5, 1e-3));
    }
}
