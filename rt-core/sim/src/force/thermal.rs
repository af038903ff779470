//! Thermal limit of the motors: the continuous force of the device over a long time.

use serde::{Deserialize, Serialize};

/// Mean square of the force over the thermal time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Warmth {
    heat_n2: f64,
}

impl Warmth {
    /// Takes a force that was given for `dt_s`.
    pub fn add(&mut self, force_n: f64, dt_s: f64, thermal_time_s: f64) {
        let share = (dt_s / thermal_time_s).clamp(0.0, 1.0);
        if share.is_finite() && force_n.is_finite() {
            self.heat_n2 += share * (force_n * force_n - self.heat_n2);
        }
    }

    /// Returns the root mean square of the force, to show with the continuous limit.
    pub fn rms_n(&self) -> f64 {
        self.heat_n2.sqrt()
    }

    /// Falls from peak to continuous force over the last fifth of what the motors can take, so that nothing
    /// drops in the operator's hand. `None` while the motors are cold.
    pub fn limit_n(&self, peak_n: f64, continuous_n: f64) -> Option<f64> {
        let spare = (5.0 * (1.0 - self.heat_n2 / (continuous_n * continuous_n))).clamp(0.0, 1.0);
        (spare < 1.0).then_some(continuous_n + (peak_n - continuous_n) * spare)
    }
}
