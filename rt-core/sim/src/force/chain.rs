//! From one sample to one wrench: velocity → layers and eq. 6 → force law → gate. All of it plain data.

use nalgebra::Vector3;
use stylet_device::{DeviceInfo, Sample, Wrench};

use super::coupling::{self, TissueForce};
use super::friction::FrictionState;
use super::gate::{self, GateInput};
use super::law::{ForceInput, ForceTerms, force};
use super::passivity::Motion;
use crate::needle::{self, Front, LayerKind, NeedleInput, NeedleParameters, Phase};

mod on_line;
mod state;

pub use on_line::step_on_line;
pub use state::{ChainOutput, ChainParameters, ChainState, Touch};

/// Least stiffness of a stuck shaft, unless the operator set less: the stiffest that every hand holds with three ticks
/// of delay (`tests/physics/src/envelope.rs`).
pub const SOFTEST_STICK_N_PER_M: f64 = 1500.0;

/// The tip in one tick, against its path.
struct Tip {
    in_world: Vector3<f64>,
    velocity_m_per_s: Vector3<f64>,
    needle_direction: Vector3<f64>,
    axis: Vector3<f64>,
    along_m: f64,
    /// `u_tip` of the membrane in front.
    depth_m: f64,
    phase: Phase,
}

/// Advances by one tick. `touch` is `None` while the tip is outside.
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
    let tip_now = Tip {
        in_world: tip,
        velocity_m_per_s,
        needle_direction,
        axis,
        along_m,
        depth_m,
        phase: needle_out.phase,
    };
    let terms = match (touch, front) {
        (Some(touch), Some(front)) => in_tissue(parameters, state, touch, &front, &tip_now, dt_s),
        _ => free(parameters, state, &tip_now),
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
        bent: None,
    }
}

/// Follows the layers that the shaft is in, and returns the membrane in front of the tip.
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

/// Applies eq. 6 against the membrane in front; returns `u_tip` as well, 0 outside. In coupled mode the tip slips in
/// the tissue only against the tissue's force, which would otherwise drive it.
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
    let mut output = needle::step(&needle_parameters, &mut state.needle, &input);
    let slip_m = axis * (1.0 - output.transmission) * moved_m.dot(axis);
    if parameters.force.coupling > 0.0 && state.coupling.drives(&slip_m) {
        // By eq. 6 alone the hand gets 1 / K_ret times what the tissue held.
        (output.transmission, output.held_step_m) = (1.0, *moved_m);
    }
    (output, front.map_or(0.0, |f| f.depth_m))
}

/// Computes eq. 8 to 10 and the tissue's answer, on the operator's hand.
fn in_tissue(
    parameters: &ChainParameters,
    state: &mut ChainState,
    touch: &Touch,
    front: &Front,
    tip: &Tip,
    dt_s: f64,
) -> ForceTerms {
    let blend_ticks = (super::TISSUE_PERIOD_S / dt_s).round().clamp(1.0, 100.0) as u32;
    let travel_m = state.held_travel_m;
    let stiffness = parameters.force.tissue_stiffness_n_per_m;
    let answer = coupling::step(
        &mut state.coupling,
        &touch.local,
        &travel_m,
        stiffness,
        &tip.axis,
        blend_ticks,
    );
    let input = ForceInput {
        tip_in_world: tip.in_world,
        velocity_m_per_s: tip.velocity_m_per_s,
        needle_direction: tip.needle_direction,
        path_origin_in_world: touch.contact_in_world,
        path_direction: tip.axis,
        along_m: tip.along_m,
        depth_m: tip.depth_m,
        membrane: front.membrane,
        tissue: front.tissue,
        shaft_friction_n: state.path.shaft_friction_n(&parameters.force.layers, tip.along_m),
        phase: tip.phase,
        punctured: state.needle.punctured,
        guided: state.path.sections().first().is_some_and(|s| s.open),
        answer: answer.map(|answer| unpulled(answer, state.needle.punctured)),
    };
    force(&parameters.force, &mut state.law, &input)
}

/// Removes the pull of a whole membrane, which lets go of a tip that leaves it.
fn unpulled(answer: TissueForce, is_punctured: bool) -> TissueForce {
    if is_punctured || answer.along_n <= 0.0 {
        return answer;
    }
    TissueForce {
        along_n: 0.0,
        stored_j: 0.0,
    }
}

/// Returns the terms outside, where there is only the weight; the sum is not finite if the sample was not.
fn free(parameters: &ChainParameters, state: &mut ChainState, tip: &Tip) -> ForceTerms {
    let none = parameters.force.layers.of(LayerKind::Surroundings);
    let input = ForceInput {
        tip_in_world: tip.in_world,
        velocity_m_per_s: tip.velocity_m_per_s,
        needle_direction: tip.axis,
        path_origin_in_world: tip.in_world,
        path_direction: tip.axis,
        along_m: 0.0,
        depth_m: 0.0,
        membrane: none,
        tissue: none,
        shaft_friction_n: 0.0,
        phase: Phase::Outside,
        punctured: false,
        guided: false,
        answer: None,
    };
    force(&parameters.force, &mut state.law, &input)
}

/// Passes the terms through the gate, whose output alone reaches the device. In debt, a stuck shaft softens: it is the
/// stiffest spring.
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
        constant_n: terms.gravity_n,
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
