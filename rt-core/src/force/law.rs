//! The force law, paper eq. 8-10: `F = F_R + F_C + F_G`, all on the operator's hand.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::friction::{FrictionLimits, FrictionState, friction};
use super::parameters::ForceParameters;
use crate::needle::Phase;

/// The tip against one membrane, in world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceInput {
    pub tip_in_world: Vector3<f64>,
    /// Filtered.
    pub velocity_m_per_s: Vector3<f64>,
    /// Any point of the straight path; the place of puncture once there is one.
    pub path_origin_in_world: Vector3<f64>,
    /// `r`: into the tissue. Taken at puncture and kept. Any length but zero.
    pub path_direction: Vector3<f64>,
    /// `u_tip`: since the tip met the membrane; negative before.
    pub depth_m: f64,
    /// `u_cri` of this membrane.
    pub puncture_depth_m: f64,
    pub phase: Phase,
    pub punctured: bool,
}

/// The terms of eq. 8 and 9 one by one, each on the operator's hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceTerms {
    /// `F_R`: the membrane before puncture.
    pub membrane_n: Vector3<f64>,
    /// First part of `F_C`.
    pub guide_n: Vector3<f64>,
    /// `K_V V` of `F_C`.
    pub damping_n: Vector3<f64>,
    /// `K_f u` of `F_C`, and the cutting force.
    pub friction_n: Vector3<f64>,
    /// `F_G`.
    pub gravity_n: Vector3<f64>,
    pub total_n: Vector3<f64>,
}

impl ForceTerms {
    pub fn zero() -> Self {
        let zero = Vector3::zeros();
        Self {
            membrane_n: zero,
            guide_n: zero,
            damping_n: zero,
            friction_n: zero,
            gravity_n: zero,
            total_n: zero,
        }
    }
}

/// What the law remembers: where the tissue holds the shaft.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ForceState {
    pub friction: FrictionState,
}

/// The force on the operator. Input that is not finite comes out as such, for the gate to catch and report.
pub fn force(parameters: &ForceParameters, state: &mut ForceState, input: &ForceInput) -> ForceTerms {
    let gravity_n = gravity(parameters);
    let axis = input.path_direction.try_normalize(1e-9);
    let (Some(axis), true) = (axis, input.phase != Phase::Outside) else {
        state.friction.release();
        let unknown = input.path_direction.sum() * 0.0
            + input.depth_m * 0.0
            + (input.tip_in_world + input.velocity_m_per_s).sum() * 0.0;
        return ForceTerms {
            gravity_n,
            total_n: gravity_n.add_scalar(unknown),
            ..ForceTerms::zero()
        };
    };
    let membrane_n = membrane(parameters, input, &axis);
    let guide_n = guide(parameters, input, &axis);
    let damping_n = damping(parameters, input, &axis, &membrane_n);
    let friction_n = shaft(parameters, &mut state.friction, input, &axis);
    ForceTerms {
        membrane_n,
        guide_n,
        damping_n,
        friction_n,
        gravity_n,
        total_n: membrane_n + guide_n + damping_n + friction_n + gravity_n,
    }
}

/// Eq. 10, read as a membrane that resists in proportion to depth, most at `u_cri`, and not at all once it
/// is open. Along `-r`, whichever way the tip moves: an elastic membrane has no reason to care, and a force
/// that did would chatter at rest.
pub fn membrane(parameters: &ForceParameters, input: &ForceInput, axis: &Vector3<f64>) -> Vector3<f64> {
    if input.punctured || input.puncture_depth_m <= 0.0 {
        return Vector3::zeros();
    }
    // `clamp` keeps what is not a number, so that the gate sees it.
    let stretched = (input.depth_m / input.puncture_depth_m).clamp(0.0, 1.0);
    axis * (-parameters.membrane_peak_n * stretched)
}

/// First part of eq. 9: towards the straight path, across it, after puncture.
pub fn guide(parameters: &ForceParameters, input: &ForceInput, axis: &Vector3<f64>) -> Vector3<f64> {
    if !input.punctured {
        return Vector3::zeros();
    }
    let from_origin = input.tip_in_world - input.path_origin_in_world;
    let offset = from_origin - axis * axis.dot(&from_origin);
    offset * (-parameters.guide_stiffness_n_per_m * parameters.guide_gain)
}

/// Second part of eq. 9, `K_V V`: against the velocity. A whole membrane lets go of a tip that leaves it
/// rather than hold it back, so there the damping takes no more than the membrane gives.
pub fn damping(
    parameters: &ForceParameters,
    input: &ForceInput,
    axis: &Vector3<f64>,
    membrane_n: &Vector3<f64>,
) -> Vector3<f64> {
    let force_n = input.velocity_m_per_s * -parameters.damping_n_s_per_m;
    if input.punctured {
        return force_n;
    }
    let inwards_n = (force_n + membrane_n).dot(axis);
    if inwards_n > 0.0 {
        force_n - axis * inwards_n
    } else {
        force_n
    }
}

/// Second part of eq. 9, `K_f u`: friction along the shaft that grows with depth and opposes motion either
/// way; on the way in the tip cuts as well.
pub fn shaft(
    parameters: &ForceParameters,
    state: &mut FrictionState,
    input: &ForceInput,
    axis: &Vector3<f64>,
) -> Vector3<f64> {
    if !input.punctured {
        state.release();
        return Vector3::zeros();
    }
    let friction_n = parameters.shaft_friction_n_per_m * input.depth_m.max(0.0);
    let limits = FrictionLimits {
        stiffness_n_per_m: parameters.stick_stiffness_n_per_m,
        forward_n: friction_n + parameters.cutting_force_n,
        backward_n: friction_n,
    };
    axis * friction(&limits, state, input.depth_m)
}

/// `F_G` of eq. 8: takes the weight of the handle off the hand, so against gravity.
pub fn gravity(parameters: &ForceParameters) -> Vector3<f64> {
    parameters.gravity_in_world_m_per_s2 * -parameters.compensated_mass_kg
}

#[cfg(test)]
#[path = "law_tests.rs"]
mod tests;
