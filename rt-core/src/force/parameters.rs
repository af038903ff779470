//! The settings of the force law, and which of them can be used.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_hw::DeviceInfo;

use super::check::{Problem, Problems};
use super::gate::GateParameters;
use crate::needle::NeedleParameters;

/// Coefficients of eq. 8-10, and the gate behind them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ForceParameters {
    /// Height of `F_R` (eq. 10): what the membrane resists with when it gives way.
    pub membrane_peak_n: f64,
    /// What the tip resists with while it cuts, once the membrane is open.
    pub cutting_force_n: f64,
    /// `K` of eq. 9, across the path.
    pub guide_stiffness_n_per_m: f64,
    /// `K_C` of eq. 9, without a unit.
    pub guide_gain: f64,
    /// `K_V` of eq. 9; not the coefficient of eq. 6, which has the same symbol.
    pub damping_n_s_per_m: f64,
    /// `K_f` of eq. 9: friction of the shaft for each metre of depth.
    pub shaft_friction_n_per_m: f64,
    /// How stiffly the tissue holds a needle that sticks to it.
    pub stick_stiffness_n_per_m: f64,
    /// Mass whose weight `F_G` (eq. 8) takes off the operator's hand.
    pub compensated_mass_kg: f64,
    pub gravity_in_world_m_per_s2: Vector3<f64>,
    pub gate: GateParameters,
}

impl Default for ForceParameters {
    fn default() -> Self {
        Self {
            membrane_peak_n: 5.6,
            cutting_force_n: 1.5,
            guide_stiffness_n_per_m: 400.0,
            guide_gain: 1.0,
            damping_n_s_per_m: 5.0,
            shaft_friction_n_per_m: 80.0,
            stick_stiffness_n_per_m: 700.0,
            compensated_mass_kg: 0.0,
            gravity_in_world_m_per_s2: Vector3::new(0.0, 0.0, -9.81),
            gate: GateParameters::default(),
        }
    }
}

impl ForceParameters {
    /// Every setting that cannot be used on any device, or `Ok`.
    pub fn validate(&self) -> Result<(), Vec<Problem>> {
        let mut problems = Problems::default();
        problems.range("force.membrane_peak_n", self.membrane_peak_n, 0.0, 30.0);
        problems.range("force.cutting_force_n", self.cutting_force_n, 0.0, 20.0);
        problems.range("force.guide_stiffness_n_per_m", self.guide_stiffness_n_per_m, 0.0, 1e4);
        problems.range("force.guide_gain", self.guide_gain, 0.0, 10.0);
        problems.range("force.damping_n_s_per_m", self.damping_n_s_per_m, 0.0, 50.0);
        problems.range("force.shaft_friction_n_per_m", self.shaft_friction_n_per_m, 0.0, 1e3);
        problems.range("force.stick_stiffness_n_per_m", self.stick_stiffness_n_per_m, 1.0, 1e4);
        problems.range("force.compensated_mass_kg", self.compensated_mass_kg, 0.0, 1.0);
        for (key, value) in [
            ("force.gravity_in_world_m_per_s2.x", self.gravity_in_world_m_per_s2.x),
            ("force.gravity_in_world_m_per_s2.y", self.gravity_in_world_m_per_s2.y),
            ("force.gravity_in_world_m_per_s2.z", self.gravity_in_world_m_per_s2.z),
        ] {
            problems.range(key, value, -20.0, 20.0);
        }
        problems.extend(self.gate.validate());
        problems.finish()
    }

    /// As [`validate`](Self::validate), and that `device` can render it: no spring stiffer than it can hold.
    pub fn validate_for(&self, needle: &NeedleParameters, device: &DeviceInfo) -> Result<(), Vec<Problem>> {
        let mut problems = Problems::default();
        problems.extend(self.validate());
        let scale = self.gate.force_scale;
        let limit = device.max_stiffness_n_per_m;
        for (key, stiffness) in [
            (
                "force.membrane_peak_n / needle.puncture_depth_m",
                self.membrane_peak_n / needle.puncture_depth_m,
            ),
            (
                "force.guide_stiffness_n_per_m * force.guide_gain",
                self.guide_stiffness_n_per_m * self.guide_gain,
            ),
            ("force.stick_stiffness_n_per_m", self.stick_stiffness_n_per_m),
        ] {
            // Not a number fails as well.
            if (stiffness * scale).is_nan() || stiffness * scale > limit {
                problems.add(
                    key,
                    stiffness,
                    format!(
                        "at most {} N/m at force scale {scale} on {}",
                        limit / scale,
                        device.name
                    ),
                );
            }
        }
        problems.finish()
    }
}
