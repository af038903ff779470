//! The tick on a prepared line: slip, membranes and the tissue's answer are one problem there (`crate::line`).
//!
//! Eq. 6 and 10 and the friction of eq. 9 have no part in it; the guide, the damping and F_G of eq. 8 and 9 stay.

use super::{ChainOutput, ChainParameters, ChainState, guard};
use crate::force::law::{self, ForceInput, ForceTerms};
use crate::line::beam::BeamOutput;
use crate::line::{HandLine, LayerForces, LeftNeedles, LineOutput};
use crate::needle::{LayerKind, Phase};
use nalgebra::Vector3;
use stylet_device::{DeviceInfo, Sample};

impl ChainParameters {
    /// Returns the resistance of each layer on a line.
    pub fn layer_forces(&self) -> LayerForces {
        LayerForces {
            layers: self.force.layers,
            membrane_gain: self.force.membrane_gain,
            cutting_gain: self.force.cutting_gain,
            shaft_gain: self.force.shaft_gain,
            creep: self.force.creep,
            bending: self.force.bending,
        }
    }
}

/// Advances a needle on `line` by one tick, in tissue or before it, with those that stay in beside it.
pub fn step_on_line(
    parameters: &ChainParameters,
    device: &DeviceInfo,
    state: &mut ChainState,
    sample: &Sample,
    line: &mut HandLine,
    mut left: Option<&mut LeftNeedles>,
    dt_s: f64,
) -> ChainOutput {
    let tip = sample.tip_in_world;
    let moved_m = tip - state.tip_in_world.unwrap_or(tip);
    let velocity_m_per_s = state.estimator.update(&tip, dt_s);
    let axis = Vector3::from(line.line().axes[0]);
    let along_m = line.along_m(&tip);
    let was_in = line.is_in_tissue();
    let answer = match &mut left {
        Some(left) => left.step_beside(line, along_m, dt_s),
        None => line.step(along_m, dt_s),
    };
    let is_in = line.is_in_tissue();
    let speed_along_m_per_s = velocity_m_per_s.dot(&axis);
    let phase = phase(
        is_in,
        &answer,
        speed_along_m_per_s,
        parameters.needle.hold_speed_m_per_s,
    );
    state.needle.phase = phase;
    state.needle.punctured = is_in && answer.held_by.is_none();
    state.needle.punctures = state
        .needle
        .punctures
        .wrapping_add(u32::from(answer.punctured.is_some()));
    let none = parameters.force.layers.of(LayerKind::Surroundings);
    let input = ForceInput {
        tip_in_world: tip,
        velocity_m_per_s,
        needle_direction: sample.direction_in_world(),
        path_origin_in_world: line.line().entry_m.into(),
        path_direction: axis,
        along_m,
        depth_m: along_m,
        membrane: none,
        tissue: none,
        shaft_friction_n: 0.0,
        phase,
        punctured: state.needle.punctured,
        guided: is_in && answer.tip_material_m > 0.0,
        answer: None,
    };
    let (bone_n, bone_j) = line.bone(along_m);
    let bent = line.bend(&tip, &sample.world_from_tool, &answer);
    let left_j = left.map_or(0.0, |left| left.elastic_j());
    let tissue_j = line.elastic_j() + bone_j + left_j;
    let mut terms = terms(parameters, &input, &axis, &answer, bone_n, tissue_j);
    if let Some(bent) = bent.as_ref().filter(|_| phase != Phase::Outside) {
        bend(&mut terms, bent, &axis, line.across());
        terms.stored_j = tissue_j + bent.stored_j;
    }
    let wrench = guard(parameters, device, state, &terms, moved_m, velocity_m_per_s, dt_s);
    state.tip_in_world = Some(tip);
    ChainOutput {
        phase,
        depth_m: if is_in { along_m - line.in_bone_m(along_m) } else { 0.0 },
        puncture_depth_m: line.puncture_depth_m(answer.held_by),
        speed_along_m_per_s,
        terms,
        axis,
        puncture: answer.punctured.is_some(),
        left: was_in && !is_in,
        wrench,
        bent,
    }
}

/// Replaces the guide by the beam, which holds the needle to its path.
fn bend(terms: &mut ForceTerms, bent: &BeamOutput, axis: &Vector3<f64>, across: [Vector3<f64>; 2]) {
    let [first, second] = across;
    let force_n = first * bent.force_on_hand_n[0] + second * bent.force_on_hand_n[1] + axis * bent.axial_n;
    let lever_nm = first * bent.moment_nm[0] + second * bent.moment_nm[1];
    terms.total_n += force_n - terms.guide_n;
    terms.guide_n = force_n;
    terms.torque_nm = axis.cross(&lever_nm);
}

fn phase(is_in: bool, answer: &LineOutput, speed_along_m_per_s: f64, hold_speed_m_per_s: f64) -> Phase {
    if !is_in {
        Phase::Outside
    } else if speed_along_m_per_s.abs() <= hold_speed_m_per_s {
        Phase::Hold
    } else if speed_along_m_per_s < 0.0 {
        Phase::Retraction
    } else if answer.held_by.is_some() {
        Phase::Contraction
    } else {
        Phase::Penetration
    }
}

fn terms(
    parameters: &ChainParameters,
    input: &ForceInput,
    axis: &Vector3<f64>,
    answer: &LineOutput,
    bone_n: f64,
    tissue_j: f64,
) -> ForceTerms {
    let force = &parameters.force;
    let gravity_n = law::gravity(force);
    // Keeps numbers that are not finite, so that the gate sees them: the line continues with its last answer.
    let unknown = (input.tip_in_world + input.velocity_m_per_s).sum() * 0.0;
    if input.phase == Phase::Outside {
        return ForceTerms {
            gravity_n,
            total_n: gravity_n.add_scalar(unknown),
            ..ForceTerms::zero()
        };
    }
    let tip_n = axis * -answer.tip_n;
    let (membrane_n, cutting_n) = match answer.held_by {
        Some(_) => (tip_n, Vector3::zeros()),
        None => (Vector3::zeros(), tip_n),
    };
    let friction_n = axis * -answer.shaft_n + cutting_n;
    let guide_n = law::guide(force, input, axis);
    let damping_n = law::damping(force, input, axis, &membrane_n);
    let beside_m = input.tip_in_world - input.path_origin_in_world - axis * input.along_m;
    let tissue_n = axis * -bone_n;
    let total_n = membrane_n + guide_n + damping_n + friction_n + gravity_n + tissue_n;
    ForceTerms {
        membrane_n,
        guide_n,
        damping_n,
        friction_n,
        gravity_n,
        tissue_n,
        total_n: total_n.add_scalar(unknown),
        torque_nm: law::guide_torque(force, input, axis),
        stored_j: tissue_j + 0.5 * guide_n.norm() * beside_m.norm(),
    }
}

#[cfg(test)]
mod tests;
