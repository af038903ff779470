//! Watches the energy that the simulator gives the hand, and damps away what it should not have given.
//!
//! Time-domain passivity (Hannaford and Ryu 2002). The force is held between ticks, so its work on the
//! measured displacement is exact. A store that may fill without bound would let a long quiet insertion
//! pay for a later instability; so it is capped.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::check::{Problem, Problems};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassivityParameters {
    /// Energy that may be held in credit.
    pub store_limit_j: f64,
    /// The controller never damps more than this.
    pub max_damping_n_s_per_m: f64,
}

impl Default for PassivityParameters {
    /// A store somewhat above what membrane and friction springs hold at most (about 0.05 J).
    fn default() -> Self {
        Self {
            store_limit_j: 0.1,
            max_damping_n_s_per_m: 20.0,
        }
    }
}

impl PassivityParameters {
    pub fn validate(&self) -> Result<(), Vec<Problem>> {
        let mut problems = Problems::default();
        problems.range("passivity.store_limit_j", self.store_limit_j, 0.0, 10.0);
        problems.range("passivity.max_damping_n_s_per_m", self.max_damping_n_s_per_m, 0.0, 50.0);
        problems.finish()
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PassivityState {
    /// Taken from the hand minus given to it. Below zero the simulator is a source of energy.
    pub energy_j: f64,
    pub interventions: u64,
}

/// The force to ask for instead of `wanted_n`.
///
/// `applied_n` is what the device exerted since the last tick and `moved_m` how far the tip went meanwhile.
pub fn step(
    parameters: &PassivityParameters,
    state: &mut PassivityState,
    applied_n: &Vector3<f64>,
    moved_m: &Vector3<f64>,
    dt_s: f64,
    wanted_n: &Vector3<f64>,
) -> Vector3<f64> {
    let taken_j = -applied_n.dot(moved_m);
    let moved_squared = moved_m.norm_squared();
    if !taken_j.is_finite() || !moved_squared.is_finite() || dt_s.is_nan() || dt_s <= 0.0 {
        return *wanted_n;
    }
    state.energy_j = (state.energy_j + taken_j).min(parameters.store_limit_j);
    if state.energy_j >= 0.0 || moved_squared <= 1e-18 {
        return *wanted_n;
    }
    // What this damping takes in the next tick, if the tip keeps its speed, is booked when it is measured.
    let damping = (-state.energy_j * dt_s / moved_squared).min(parameters.max_damping_n_s_per_m);
    state.interventions = state.interventions.wrapping_add(1);
    wanted_n - moved_m * (damping / dt_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall of `stiffness` against a mass in a weak hand, sampled at 1 kHz: past the stable stiffness
    /// without the controller. Gives the largest penetration of the last second.
    fn wall(stiffness: f64, controlled: bool) -> (f64, u64) {
        let parameters = PassivityParameters {
            store_limit_j: 1e-3,
            ..PassivityParameters::default()
        };
        let mut state = PassivityState::default();
        let (mut x, mut v, mut applied, mut late) = (0.0, 0.02, 0.0, 0.0f64);
        for tick in 0..5000 {
            let before = x;
            for _ in 0..20 {
                let hand = 0.5 - 0.2 * v;
                v += 5e-5 * (applied + hand) / 0.175;
                x += 5e-5 * v;
            }
            let wanted = if x > 0.0 { -stiffness * x } else { 0.0 };
            let moved = Vector3::new(x - before, 0.0, 0.0);
            let given = Vector3::new(applied, 0.0, 0.0);
            applied = wanted;
            if controlled {
                let asked = Vector3::new(wanted, 0.0, 0.0);
                applied = step(&parameters, &mut state, &given, &moved, 1e-3, &asked).x;
            }
            if tick > 4000 {
                late = late.max(v.abs());
            }
        }
        (late, state.interventions)
    }

    #[test]
    fn a_wall_past_its_stable_stiffness_is_quietened() {
        // b < K T / 2: 0.2 against 0.4 and 2.0 N s/m.
        for stiffness in [800.0, 4000.0] {
            let (free, _) = wall(stiffness, false);
            let (held, interventions) = wall(stiffness, true);
            assert!(free > 0.05, "the wall of {stiffness} N/m should sing: {free}");
            assert!(held < 0.2 * free, "{stiffness} N/m: {held} against {free}");
            assert!(interventions > 0);
        }
    }

    #[test]
    fn a_passive_force_is_left_alone() {
        let parameters = PassivityParameters::default();
        let mut state = PassivityState::default();
        for i in 0..1000 {
            let moved = Vector3::new(1e-5 * f64::from(i).cos(), 0.0, 0.0);
            let drag = -moved * 1e3;
            let out = step(&parameters, &mut state, &drag, &moved, 1e-3, &drag);
            assert_eq!(out, drag);
        }
        assert_eq!(state.interventions, 0);
        assert!(state.energy_j <= parameters.store_limit_j);
    }
}
