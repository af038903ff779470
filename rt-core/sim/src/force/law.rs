//! The force law, paper eq. 8-10: `F = F_R + F_C + F_G`, all on the operator's hand.
//!
//! On a needle line, the default, `crate::line` computes membranes, cutting and friction; guide, damping and weight are
//! those of this file (`chain/on_line.rs`).

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::coupling::TissueForce;
use super::friction::{FrictionLimits, FrictionState, friction};
use super::parameters::ForceParameters;
use crate::needle::{Layer, Phase};

/// The tip against the layers of one path, in world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceInput {
    /// Place of the tip, m.
    pub tip_in_world: Vector3<f64>,
    /// Filtered.
    pub velocity_m_per_s: Vector3<f64>,
    /// Unit vector along the needle in the hand.
    pub needle_direction: Vector3<f64>,
    /// Any point of the straight path; the place of contact once there is one.
    pub path_origin_in_world: Vector3<f64>,
    /// `r`: into the tissue. Taken at contact and kept. Any length but zero.
    pub path_direction: Vector3<f64>,
    /// Distance of the tip along the path from the place of contact.
    pub along_m: f64,
    /// `u_tip`: since the tip met the membrane in front; negative before.
    pub depth_m: f64,
    /// Layer of the membrane in front, or of the last one.
    pub membrane: Layer,
    /// The layer that the tip cuts.
    pub tissue: Layer,
    /// Size of `K_f u`, summed over the layers that the shaft is in.
    pub shaft_friction_n: f64,
    /// Phase of eq. 6.
    pub phase: Phase,
    /// Set while the membrane in front is open.
    pub punctured: bool,
    /// Set while the tip is in the tissue proper: some membrane is open, or there is none.
    pub guided: bool,
    /// Force of the deformed tissue at the tip; `None` where the model has none.
    pub answer: Option<TissueForce>,
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
    /// Coupled mode: the tissue's answer, instead of its share of membrane and friction.
    pub tissue_n: Vector3<f64>,
    /// Sum of all terms (eq. 8).
    pub total_n: Vector3<f64>,
    /// Torque that keeps the needle's axis along the path.
    pub torque_nm: Vector3<f64>,
    /// Energy that the springs of these terms hold and may give back.
    pub stored_j: f64,
}

impl ForceTerms {
    /// Returns no force at all.
    pub fn zero() -> Self {
        let zero = Vector3::zeros();
        Self {
            membrane_n: zero,
            guide_n: zero,
            damping_n: zero,
            friction_n: zero,
            gravity_n: zero,
            tissue_n: zero,
            total_n: zero,
            torque_nm: zero,
            stored_j: 0.0,
        }
    }
}

/// State of the law: the place where the tissue holds the shaft.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ForceState {
    /// Anchor of the stuck shaft.
    pub friction: FrictionState,
}

/// Returns the force on the operator. Input that is not finite comes out as such, for the gate to catch and report.
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
    // What the tissue answers takes the place of what eq. 9 and 10 say along the path.
    let coupling = if input.answer.is_some() {
        parameters.coupling
    } else {
        0.0
    };
    let tissue_n = axis * (input.answer.map_or(0.0, |answer| answer.along_n) * coupling);
    let tissue_j = input.answer.map_or(0.0, |answer| answer.stored_j) * coupling;
    let membrane_n = membrane(parameters, input, &axis) * (1.0 - coupling);
    let guide_n = guide(parameters, input, &axis);
    let elastic_n = membrane_n + tissue_n;
    let damping_n = damping(parameters, input, &axis, &elastic_n);
    let limits = friction_limits(parameters, input);
    let friction_n = shaft(&limits, &mut state.friction, input, &axis) * (1.0 - coupling);
    let springs_j = 0.5 * (membrane_n.norm() * input.depth_m.abs() + guide_n.norm() * offset(input, &axis).norm());
    ForceTerms {
        membrane_n,
        guide_n,
        damping_n,
        friction_n,
        gravity_n,
        tissue_n,
        total_n: membrane_n + guide_n + damping_n + friction_n + gravity_n + tissue_n,
        torque_nm: guide_torque(parameters, input, &axis),
        stored_j: springs_j + tissue_j + state.friction.stored_j(&limits) * (1.0 - coupling),
    }
}

/// Computes eq. 10, read as a membrane that resists in proportion to depth, most at `u_cri`, and not at all once it is
/// open. It acts along `-r`, whichever way the tip moves: a force that depended on the direction would chatter at rest.
pub fn membrane(parameters: &ForceParameters, input: &ForceInput, axis: &Vector3<f64>) -> Vector3<f64> {
    if input.punctured || !input.membrane.has_membrane() {
        return Vector3::zeros();
    }
    // `clamp` keeps NaN, so that the gate sees it.
    let stretched = (input.depth_m / input.membrane.puncture_depth_m).clamp(0.0, 1.0);
    axis * (-parameters.membrane_gain * input.membrane.puncture_force_n * stretched)
}

fn offset(input: &ForceInput, axis: &Vector3<f64>) -> Vector3<f64> {
    let from_origin = input.tip_in_world - input.path_origin_in_world;
    from_origin - axis * axis.dot(&from_origin)
}

/// Returns the first part of eq. 9: towards the straight path, across it, once the needle is in.
pub fn guide(parameters: &ForceParameters, input: &ForceInput, axis: &Vector3<f64>) -> Vector3<f64> {
    if !input.guided {
        return Vector3::zeros();
    }
    offset(input, axis) * (-parameters.guide_stiffness_n_per_m * parameters.guide_gain)
}

/// Returns the part of the guide that a device of six degrees of freedom can give: a torque about the place of entry
/// that turns the needle's axis to the path, in proportion to the sine of the angle between them.
pub fn guide_torque(parameters: &ForceParameters, input: &ForceInput, axis: &Vector3<f64>) -> Vector3<f64> {
    if !input.guided {
        return Vector3::zeros();
    }
    input.needle_direction.cross(axis) * (parameters.guide_torque_nm_per_rad * parameters.guide_gain)
}

/// Computes the second part of eq. 9, `K_V V`: against the velocity. A whole membrane releases a tip that leaves it
/// rather than hold it back, so there the damping takes no more than the membrane gives.
pub fn damping(
    parameters: &ForceParameters,
    input: &ForceInput,
    axis: &Vector3<f64>,
    membrane_n: &Vector3<f64>,
) -> Vector3<f64> {
    let force_n = input.velocity_m_per_s * -parameters.damping_n_s_per_m;
    if input.guided {
        return force_n;
    }
    let inwards_n = (force_n + membrane_n).dot(axis);
    if inwards_n > 0.0 {
        force_n - axis * inwards_n
    } else {
        force_n
    }
}

fn friction_limits(parameters: &ForceParameters, input: &ForceInput) -> FrictionLimits {
    let friction_n = parameters.shaft_gain * input.shaft_friction_n;
    let cutting_n = if input.punctured {
        parameters.cutting_gain * input.tissue.cutting_force_n
    } else {
        0.0
    };
    FrictionLimits {
        stiffness_n_per_m: parameters.stick_stiffness_n_per_m,
        damping_n_s_per_m: parameters.stick_damping_n_s_per_m,
        forward_n: friction_n + cutting_n,
        backward_n: friction_n,
    }
}

/// Computes the second part of eq. 9, `K_f u`: friction along the shaft that grows with depth and opposes motion either
/// way; on the way in the tip cuts as well.
pub fn shaft(
    limits: &FrictionLimits,
    state: &mut FrictionState,
    input: &ForceInput,
    axis: &Vector3<f64>,
) -> Vector3<f64> {
    if !input.guided {
        state.release();
        return Vector3::zeros();
    }
    axis * friction(limits, state, input.along_m, input.velocity_m_per_s.dot(axis))
}

/// Computes `F_G` of eq. 8: it takes the weight of the handle off the hand, so it acts against gravity.
pub fn gravity(parameters: &ForceParameters) -> Vector3<f64> {
    parameters.gravity_in_world_m_per_s2 * -parameters.compensated_mass_kg
}

#[cfg(test)]
mod tests;
