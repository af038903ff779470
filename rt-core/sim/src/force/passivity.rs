//! Passivity control: accounts for the energy that the simulator gives the hand, and damps away any excess.
//!
//! Time-domain passivity (Hannaford and Ryu 2002). The force is held between ticks, so its work on the
//! measured displacement is exact, if it is known when the force began to act. A link may be late by some
//! ticks and does not say so: the work is booked for each possible lateness, and the worst account counts.
//! An account holds no more than what the springs of the force law hold now, and a margin: what was
//! dissipated cannot pay for a later instability. What rounding the position may have hidden is not
//! held against the simulator: half an encoder step times the change of the force.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::settings::{Problem, Problems};

/// Number of delays that are accounted for: 0 to 3 ticks.
pub const DELAYS: usize = 4;

/// Settings of the energy account.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PassivityParameters {
    /// Energy that may be held in credit beyond what the springs hold.
    pub margin_j: f64,
    /// The controller never damps more than this; 0 turns it off. Late damping drives a light hand, so not much.
    pub max_damping_n_s_per_m: f64,
}

impl Default for PassivityParameters {
    fn default() -> Self {
        Self {
            margin_j: 5e-3,
            max_damping_n_s_per_m: 5.0,
        }
    }
}

impl PassivityParameters {
    /// Parameters that only watch.
    pub const OFF: Self = Self {
        margin_j: 5e-3,
        max_damping_n_s_per_m: 0.0,
    };

    /// Returns every setting that cannot be used, or `Ok`.
    pub fn validate(&self) -> Result<(), Vec<Problem>> {
        let mut problems = Problems::default();
        problems.range("passivity.margin_j", self.margin_j, 0.0, 10.0);
        problems.range("passivity.max_damping_n_s_per_m", self.max_damping_n_s_per_m, 0.0, 50.0);
        problems.finish()
    }
}

/// The energy accounts of one device.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PassivityState {
    /// Taken from the hand minus given to it, by lateness. Below zero the simulator is a source of energy.
    accounts_j: [f64; DELAYS],
    /// Forces asked of the device, newest first.
    forces_n: [Vector3<f64>; DELAYS + 1],
    /// Set while the account is in debt, as of the last tick.
    in_debt: bool,
}

impl PassivityState {
    /// Returns the worst account.
    pub fn energy_j(&self) -> f64 {
        self.accounts_j.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Returns whether the worst account was below zero in the last tick, with the controller on.
    pub fn in_debt(&self) -> bool {
        self.in_debt
    }

    /// Books the force that the device is asked for in this tick.
    pub fn book(&mut self, given_n: &Vector3<f64>) {
        self.forces_n.rotate_right(1);
        if let Some(newest) = self.forces_n.first_mut() {
            *newest = *given_n;
        }
    }
}

/// One tick of motion, as the device measured it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Since the last tick.
    pub moved_m: Vector3<f64>,
    /// Filtered.
    pub velocity_m_per_s: Vector3<f64>,
    /// Step of the encoders, m.
    pub position_step_m: f64,
    /// Time since the last tick, s.
    pub dt_s: f64,
}

/// Returns the force to ask for instead of `wanted_n`; `stored_j` is what the springs behind it hold.
pub fn step(
    parameters: &PassivityParameters,
    state: &mut PassivityState,
    motion: &Motion,
    stored_j: f64,
    wanted_n: &Vector3<f64>,
) -> Vector3<f64> {
    let most_j = parameters.margin_j + if stored_j.is_finite() { stored_j.max(0.0) } else { 0.0 };
    for (account_j, forces_n) in state.accounts_j.iter_mut().zip(state.forces_n.windows(2)) {
        let [force_n, before_n] = [forces_n[0], forces_n[1]];
        let hidden_j = 0.5 * motion.position_step_m * (force_n - before_n).abs().sum();
        let taken_j = hidden_j - force_n.dot(&motion.moved_m);
        if taken_j.is_finite() {
            *account_j = (*account_j + taken_j).min(most_j);
        }
    }
    let debt_j = -state.energy_j();
    state.in_debt = parameters.max_damping_n_s_per_m > 0.0 && debt_j > 0.0;
    let power = motion.velocity_m_per_s.norm_squared() * motion.dt_s;
    if !state.in_debt || power.is_nan() || power <= 0.0 {
        return *wanted_n;
    }
    // What this damping takes in the next tick, if the tip keeps its speed, is booked when it is measured.
    let damping = (debt_j / power).min(parameters.max_damping_n_s_per_m);
    wanted_n - motion.velocity_m_per_s * damping
}

#[cfg(test)]
mod tests;
