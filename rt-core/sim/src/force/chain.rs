//! From one sample to one wrench: velocity → layers and eq. 6 → force law → gate. All of it plain data.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_hw::{DeviceInfo, Sample, Wrench};

use super::chatter::ChatterState;
use super::coupling::{self, CouplingState, LocalResponse};
use super::friction::FrictionState;
use super::gate::{self, GateInput, GateState};
use super::law::{ForceInput, ForceState, ForceTerms, force};
use super::parameters::ForceParameters;
use super::passivity::Motion;
use super::velocity::VelocityEstimator;
use crate::needle::{self, Front, LayerKind, NeedleInput, NeedleParameters, NeedlePath, NeedleState, Phase};

/// A stuck shaft is never softer than this, unless the operator set it so: the stiffest that every hand holds
/// with three ticks of delay (`tests/force_envelope.rs`).
pub const SOFTEST_STICK_N_PER_M: f64 = 1500.0;

/// Settings; changed as a whole at a tick.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct ChainParameters {
    /// Coefficients of eq. 6.
    pub needle: NeedleParameters,
    /// Coefficients of eq. 8 to 10, and the gate.
    pub force: ForceParameters,
}

/// Where the tip meets tissue, as the tissue loop found it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Place where the tip met the tissue, m.
    pub contact_in_world: Vector3<f64>,
    /// r of eq. 6, kept for the whole contact.
    pub path_direction: Vector3<f64>,
    /// The innermost layer met, its number, and the place where it was.
    pub layer: LayerKind,
    /// Number of that meeting; rises with each.
    pub layer_number: u64,
    /// Place where the tip met that layer, m.
    pub layer_in_world: Vector3<f64>,
    /// What the tissue answers at the tip.
    pub local: LocalResponse,
}

/// Everything that one tick leaves to the next.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct ChainState {
    /// Tip velocity from positions.
    pub estimator: VelocityEstimator,
    /// Phase and puncture of the membrane in front.
    pub needle: NeedleState,
    /// Layers that the shaft is in.
    pub path: NeedlePath,
    /// Friction of the shaft.
    pub law: ForceState,
    /// Turns of a tip that shakes.
    pub chatter: ChatterState,
    /// The tissue's answer, blended in.
    pub coupling: CouplingState,
    /// The last limits before the device.
    pub gate: GateState,
    /// Tip of the last sample, m; `None` before the first.
    pub tip_in_world: Option<Vector3<f64>>,
    /// Sum of the held element's steps (eq. 6).
    pub held_travel_m: Vector3<f64>,
}

/// What came of one tick.
#[derive(Debug, Clone, Copy)]
pub struct ChainOutput {
    /// What the needle does to the tissue.
    pub phase: Phase,
    /// `u_tip` of the membrane in front; 0 outside.
    pub depth_m: f64,
    /// `u_cri` of that membrane; 0 outside and where the tissue has none.
    pub puncture_depth_m: f64,
    /// Tip velocity along the path, m/s, positive inwards.
    pub speed_along_m_per_s: f64,
    /// The force law, term by term.
    pub terms: ForceTerms,
    /// Insertion direction: of the path in contact, else of the needle.
    pub axis: Vector3<f64>,
    /// A membrane gave way in this tick.
    pub puncture: bool,
    /// The tip left the tissue in this tick.
    pub left: bool,
    /// What goes to the device.
    pub wrench: Wrench,
}

impl ChainState {
    /// Outside the tissue, with the force disengaged.
    pub fn new(device: &DeviceInfo) -> Self {
        Self {
            estimator: VelocityEstimator::new(device.position_step_m),
            needle: NeedleState::default(),
            path: NeedlePath::default(),
            law: ForceState::default(),
            chatter: ChatterState::default(),
            coupling: CouplingState::default(),
            gate: GateState::default(),
            tip_in_world: None,
            held_travel_m: Vector3::zeros(),
        }
    }

    /// The needle is out: tissue holds nothing of it.
    pub fn end_contact(&mut self) {
        self.needle = NeedleState {
            punctures: self.needle.punctures,
            ..NeedleState::default()
        };
        self.path.clear();
        self.law = ForceState::default();
        self.chatter = ChatterState::default();
        self.coupling.release();
    }
}

/// One tick. `touch` is `None` while the tip is outside.
pub fn step(
    parameters: &ChainParameters,
    device: &DeviceInfo,
    state: &mut ChainState,
    sample: &Sample,
    touch: Option<&Touch>,
    dt_s: f64,
) -> ChainOutput {
    let tip = sample.tip_in_world;
    let moved_m = tip - state.tip_in_world.unwrap_or(tip);
    let velocity_m_per_s = state.estimator.update(&tip, dt_s);
    let needle_direction = sample.direction_in_world();
    let axis = touch.map_or(needle_direction, |t| t.path_direction);
    let along_m = touch.map_or(0.0, |t| (tip - t.contact_in_world).dot(&axis));
    let front = touch.and_then(|t| follow_path(parameters, state, t, &axis, along_m));
    let (needle_out, depth_m) = follow_needle(parameters, state, front.as_ref(), &axis, &velocity_m_per_s, &moved_m);
    state.held_travel_m += needle_out.held_step_m;
    let left = touch.is_some() && needle_out.phase == Phase::Outside;
    if left {
        state.end_contact();
    }
    if needle_out.puncture {
        state.path.open();
    }
    let controlled = parameters.force.gate.passivity.max_damping_n_s_per_m > 0.0;
    let shakes = controlled && touch.is_some() && state.chatter.shakes(along_m, device.position_step_m, dt_s);
    if shakes {
        soften(&mut state.law.friction, 0.8, parameters.force.stick_stiffness_n_per_m);
    }
    let terms = match (touch, front) {
        (Some(touch), Some(front)) => {
            let blend_ticks = (super::TISSUE_PERIOD_S / dt_s).round().clamp(1.0, 100.0) as u32;
            let travel_m = state.held_travel_m;
            let stiffness = parameters.force.tissue_stiffness_n_per_m;
            let tissue_n = coupling::step(
                &mut state.coupling,
                &touch.local,
                &travel_m,
                stiffness,
                &axis,
                blend_ticks,
            );
            let input = ForceInput {
                tip_in_world: tip,
                velocity_m_per_s,
                needle_direction,
                path_origin_in_world: touch.contact_in_world,
                path_direction: axis,
                along_m,
                depth_m,
                membrane: front.membrane,
                tissue: front.tissue,
                shaft_friction_n: state.path.shaft_friction_n(&parameters.force.layers, along_m),
                phase: needle_out.phase,
                punctured: state.needle.punctured,
                guided: state.path.sections().first().is_some_and(|s| s.open),
                tissue_n: tissue_n.map(|n| if state.needle.punctured { n } else { n.min(0.0) }),
            };
            force(&parameters.force, &mut state.law, &input)
        }
        _ => free(parameters, state, &tip, &velocity_m_per_s, &axis),
    };
    let wrench = guard(parameters, device, state, &terms, moved_m, velocity_m_per_s, dt_s);
    state.tip_in_world = Some(tip);
    ChainOutput {
        phase: needle_out.phase,
        depth_m,
        puncture_depth_m: front.map_or(0.0, |f| f.membrane.puncture_depth_m),
        speed_along_m_per_s: velocity_m_per_s.dot(&axis),
        terms,
        axis,
        puncture: needle_out.puncture,
        left,
        wrench,
    }
}

/// Which layers the shaft is in, and what is in front of the tip.
fn follow_path(
    parameters: &ChainParameters,
    state: &mut ChainState,
    touch: &Touch,
    axis: &Vector3<f64>,
    along_m: f64,
) -> Option<Front> {
    let layers = &parameters.force.layers;
    let met_m = (touch.layer_in_world - touch.contact_in_world).dot(axis);
    if state.path.meet(layers, touch.layer, touch.layer_number, met_m) {
        state.needle.punctured = !layers.of(touch.layer).has_membrane();
    }
    if state.path.leave(along_m, parameters.needle.hysteresis_m) {
        state.needle.punctured = true;
    }
    state.path.front(layers, along_m)
}

/// Eq. 6 against the membrane in front; gives `u_tip` as well, 0 outside.
fn follow_needle(
    parameters: &ChainParameters,
    state: &mut ChainState,
    front: Option<&Front>,
    axis: &Vector3<f64>,
    velocity_m_per_s: &Vector3<f64>,
    moved_m: &Vector3<f64>,
) -> (needle::NeedleOutput, f64) {
    let needle_parameters = NeedleParameters {
        puncture_depth_m: front.map_or(parameters.needle.puncture_depth_m, |f| f.membrane.puncture_depth_m),
        ..parameters.needle
    };
    let input = NeedleInput {
        depth_m: front.map_or(-1.0, |f| f.depth_m),
        speed_along_m_per_s: velocity_m_per_s.dot(axis),
        speed_m_per_s: velocity_m_per_s.norm(),
        tip_step_m: *moved_m,
    };
    let output = needle::step(&needle_parameters, &mut state.needle, &input);
    (output, front.map_or(0.0, |f| f.depth_m))
}

/// Outside there is only the weight; the sum says so if the sample was no number.
fn free(
    parameters: &ChainParameters,
    state: &mut ChainState,
    tip: &Vector3<f64>,
    velocity_m_per_s: &Vector3<f64>,
    axis: &Vector3<f64>,
) -> ForceTerms {
    let none = parameters.force.layers.of(LayerKind::Surroundings);
    let input = ForceInput {
        tip_in_world: *tip,
        velocity_m_per_s: *velocity_m_per_s,
        needle_direction: *axis,
        path_origin_in_world: *tip,
        path_direction: *axis,
        along_m: 0.0,
        depth_m: 0.0,
        membrane: none,
        tissue: none,
        shaft_friction_n: 0.0,
        phase: Phase::Outside,
        punctured: false,
        guided: false,
        tissue_n: None,
    };
    force(&parameters.force, &mut state.law, &input)
}

/// The gate: its output alone reaches the device. In debt, a stuck shaft softens: it is the stiffest spring.
fn guard(
    parameters: &ChainParameters,
    device: &DeviceInfo,
    state: &mut ChainState,
    terms: &ForceTerms,
    moved_m: Vector3<f64>,
    velocity_m_per_s: Vector3<f64>,
    dt_s: f64,
) -> Wrench {
    let input = GateInput {
        wanted: Wrench {
            force_n: terms.total_n,
            torque_nm: terms.torque_nm,
        },
        stored_j: terms.stored_j,
        motion: Motion {
            moved_m,
            velocity_m_per_s,
            position_step_m: device.position_step_m,
            dt_s,
        },
    };
    let output = gate::step(&parameters.force.gate, device, &mut state.gate, &input);
    if state.gate.passivity().in_debt() {
        soften(&mut state.law.friction, 0.9, parameters.force.stick_stiffness_n_per_m);
    }
    output.wrench
}

fn soften(friction: &mut FrictionState, by: f64, stiffness_n_per_m: f64) {
    friction.soften(by, SOFTEST_STICK_N_PER_M / stiffness_n_per_m.max(1.0));
}

#[cfg(test)]
mod tests;
