//! Settings of the gate.

use serde::{Deserialize, Serialize};

use crate::force::passivity::PassivityParameters;
use crate::settings::{Problem, Problems};

/// Ticks of the ramp to zero.
pub const RAMP_OUT_TICKS: u32 = 20;

/// Settings of the gate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GateParameters {
    /// Force of the device for each newton of the model: real needles reach 9 to 16 N. Shown to the operator.
    pub force_scale: f64,
    /// Largest force, N.
    pub max_force_n: f64,
    /// Largest change of the force, N/s.
    pub slew_n_per_s: f64,
    /// Largest change of the torque, Nm/s.
    pub torque_slew_nm_per_s: f64,
    /// Engaging waits until the model asks for no more than this, so that nothing kicks.
    pub engage_below_n: f64,
    /// Ticks over which the force comes in.
    pub ramp_in_ticks: u32,
    /// Ticks of the ramp out, also where that is steeper than the slew limit.
    pub ramp_out_ticks: u32,
    /// Time constant of the motors' warming, for the limit on continuous force.
    pub thermal_time_s: f64,
    /// The energy account and its damping.
    pub passivity: PassivityParameters,
}

impl Default for GateParameters {
    fn default() -> Self {
        Self {
            force_scale: 0.9,
            max_force_n: 8.5,
            slew_n_per_s: 500.0,
            torque_slew_nm_per_s: 10.0,
            engage_below_n: 1.0,
            ramp_in_ticks: 200,
            ramp_out_ticks: RAMP_OUT_TICKS,
            thermal_time_s: 600.0,
            passivity: PassivityParameters::default(),
        }
    }
}

impl GateParameters {
    /// Returns every setting that cannot be used, or `Ok`.
    pub fn validate(&self) -> Result<(), Vec<Problem>> {
        let mut problems = Problems::default();
        problems.range("gate.force_scale", self.force_scale, 0.0, 2.0);
        problems.range("gate.max_force_n", self.max_force_n, 0.0, 40.0);
        problems.range("gate.slew_n_per_s", self.slew_n_per_s, 1.0, 1e5);
        problems.range("gate.torque_slew_nm_per_s", self.torque_slew_nm_per_s, 1e-3, 1e3);
        problems.range("gate.engage_below_n", self.engage_below_n, 0.0, 10.0);
        problems.range("gate.ramp_in_ticks", f64::from(self.ramp_in_ticks), 1.0, 1e4);
        problems.range("gate.ramp_out_ticks", f64::from(self.ramp_out_ticks), 1.0, 100.0);
        problems.range("gate.thermal_time_s", self.thermal_time_s, 1.0, 1e5);
        problems.extend(self.passivity.validate());
        problems.finish()
    }
}
