//! Settings of the force law, with their validation. `crate::active` sets them from the table of parameters.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::gate::GateParameters;
use crate::line::{NeedleBending, PronyTerm};
use crate::needle::Layers;
use crate::settings::{Problem, Problems};

/// Beyond it a stuck shaft oscillates at 1 kHz in the lightest hand, without any delay
/// (`tests/physics/src/envelope.rs`).
pub const MAX_STICK_STIFFNESS_N_PER_M: f64 = 8000.0;

/// Coefficients of eq. 8-10, and the gate behind them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ForceParameters {
    /// Layers on the way: membrane, cutting and friction of each.
    pub layers: Layers,
    /// Scales `F_R` of every layer; 0 turns the term off. The next two as well.
    pub membrane_gain: f64,
    /// Scales the cutting force of every layer.
    pub cutting_gain: f64,
    /// Scales `K_f u` (eq. 9) of every layer.
    pub shaft_gain: f64,
    /// Share of membrane, cutting and friction that the tissue's own answer takes the place of: 0 for eq. 8-10
    /// alone, 1 for coupled mode.
    pub coupling: f64,
    /// Stiffness of tissue without forces of its own (ChainMail) against displacement of the held element.
    pub tissue_stiffness_n_per_m: f64,
    /// `K` of eq. 9, across the path.
    pub guide_stiffness_n_per_m: f64,
    /// `K_C` of eq. 9, without a unit.
    pub guide_gain: f64,
    /// `K_V` of eq. 9; not the coefficient of eq. 6, which has the same symbol.
    pub damping_n_s_per_m: f64,
    /// Turns the needle's axis to the path, with `K_C`.
    pub guide_torque_nm_per_rad: f64,
    /// Stiffness of the tissue around a needle that sticks to it.
    pub stick_stiffness_n_per_m: f64,
    /// Damping in parallel to that spring: takes the energy that sampling leaks into it.
    pub stick_damping_n_s_per_m: f64,
    /// Mass whose weight `F_G` (eq. 8) takes off the operator's hand.
    pub compensated_mass_kg: f64,
    /// Creep of tissue on a needle line under a constant load; strengths of 0 turn it off.
    pub creep: [PronyTerm; 2],
    /// Bending of the needle on a needle line.
    pub bending: NeedleBending,
    /// Acceleration of gravity in world, m/s^2.
    pub gravity_in_world_m_per_s2: Vector3<f64>,
    /// Settings of the gate.
    pub gate: GateParameters,
}

impl Default for ForceParameters {
    fn default() -> Self {
        Self {
            layers: Layers::default(),
            membrane_gain: 1.0,
            cutting_gain: 1.0,
            shaft_gain: 1.0,
            coupling: 0.0,
            tissue_stiffness_n_per_m: 700.0,
            guide_stiffness_n_per_m: 400.0,
            guide_gain: 1.0,
            damping_n_s_per_m: 5.0,
            guide_torque_nm_per_rad: 0.5,
            stick_stiffness_n_per_m: 6000.0,
            stick_damping_n_s_per_m: 10.0,
            compensated_mass_kg: 0.0,
            creep: [PronyTerm::default(); 2],
            bending: NeedleBending::default(),
            gravity_in_world_m_per_s2: Vector3::new(0.0, 0.0, -9.81),
            gate: GateParameters::default(),
        }
    }
}

impl ForceParameters {
    /// Returns every setting that cannot be used on any device, or `Ok`. What a device cannot hold is refused before:
    /// [`stylet_settings::ParameterSet::problems_on`].
    pub fn validate(&self) -> Result<(), Vec<Problem>> {
        let mut problems = Problems::default();
        problems.extend(self.layers.validate());
        problems.range("force.membrane_gain", self.membrane_gain, 0.0, 2.0);
        problems.range("force.cutting_gain", self.cutting_gain, 0.0, 2.0);
        problems.range("force.shaft_gain", self.shaft_gain, 0.0, 2.0);
        problems.range("force.coupling", self.coupling, 0.0, 1.0);
        problems.range(
            "force.tissue_stiffness_n_per_m",
            self.tissue_stiffness_n_per_m,
            0.0,
            1e4,
        );
        problems.range("force.guide_stiffness_n_per_m", self.guide_stiffness_n_per_m, 0.0, 1e4);
        problems.range("force.guide_gain", self.guide_gain, 0.0, 10.0);
        problems.range("force.damping_n_s_per_m", self.damping_n_s_per_m, 0.0, 50.0);
        problems.range("force.guide_torque_nm_per_rad", self.guide_torque_nm_per_rad, 0.0, 5.0);
        problems.range(
            "force.stick_stiffness_n_per_m",
            self.stick_stiffness_n_per_m,
            1.0,
            MAX_STICK_STIFFNESS_N_PER_M,
        );
        problems.range("force.stick_damping_n_s_per_m", self.stick_damping_n_s_per_m, 0.0, 50.0);
        problems.range("force.compensated_mass_kg", self.compensated_mass_kg, 0.0, 1.0);
        for term in self.creep {
            problems.range("force.creep.strength", term.strength, 0.0, 10.0);
            problems.range("force.creep.time_s", term.time_s, 1e-3, 1e5);
        }
        let bending = &self.bending;
        problems.range(
            "force.bending.bending_stiffness_n_m2",
            bending.bending_stiffness_n_m2,
            0.0,
            10.0,
        );
        problems.range("force.bending.bevel", bending.bevel, 0.0, 5.0);
        problems.range("force.bending.template_gap_m", bending.template_gap_m, 0.0, 0.01);
        problems.range(
            "force.bending.template_distance_m",
            bending.template_distance_m,
            0.0,
            0.5,
        );
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
}
