//! Types of the chain: settings, contact, state and output.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_device::{DeviceInfo, Wrench};

use crate::force::chatter::ChatterState;
use crate::force::coupling::{CouplingState, LocalResponse};
use crate::force::gate::GateState;
use crate::force::law::{ForceState, ForceTerms};
use crate::force::parameters::ForceParameters;
use crate::force::velocity::VelocityEstimator;
use crate::line::beam::BeamOutput;
use crate::needle::{LayerKind, NeedleParameters, NeedlePath, NeedleState, Phase};

/// Settings; changed as a whole at a tick.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct ChainParameters {
    /// Coefficients of eq. 6.
    pub needle: NeedleParameters,
    /// Coefficients of eq. 8 to 10, and the gate.
    pub force: ForceParameters,
}

/// Contact of the tip with tissue, as the tissue loop found it.
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
    /// Response of the tissue at the tip.
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

/// Outcome of one tick.
#[derive(Debug, Clone, Copy)]
pub struct ChainOutput {
    /// Interaction of needle and tissue.
    pub phase: Phase,
    /// `u_tip` of the membrane in front; 0 outside.
    pub depth_m: f64,
    /// `u_cri` of that membrane, m; 0 outside and where the tissue has none.
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
    /// Wrench for the device.
    pub wrench: Wrench,
    /// The bent needle, where it bends and is on a line.
    pub bent: Option<BeamOutput>,
}

impl ChainState {
    /// Returns the state outside the tissue, with the force disengaged.
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

    /// Ends the contact of a needle that is out: tissue holds nothing of it.
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
