//! What the two loops and the bridge hand each other: plain data through wait-free rings and triple buffers.

use crate::rt::tissue_tape::TissueTape;
use crate::rt::world::World;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_hw::HandGoal;
use stylet_shm_schema::{Fault, RefusalCode, SnapshotHeader, TickRecord, Vertex};
use stylet_sim::force::chain::Touch;
use stylet_sim::force::{ForceParameters, LocalResponse};
use stylet_sim::limits::Limits;
use stylet_sim::needle::{LayerKind, NeedleParameters, Phase};

/// Haptic to tissue, each tick: the newest pose.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct TipPose {
    pub time_ns: u64,
    pub tip_in_scene: Vector3<f64>,
    pub direction: Vector3<f64>,
    /// Inwards along the needle, filtered.
    pub speed_along_m_per_s: f64,
    pub phase: Phase,
    pub punctured: bool,
    /// Sum of the held element's steps (eq. 6) since the loop began; its differences drive the tissue.
    pub held_travel_m: Vector3<f64>,
    /// The last contact that the haptic loop has ended.
    pub released_contact: u64,
    /// Number of the innermost layer that the shaft is in, and the largest number taken up so far.
    pub innermost_layer: u64,
    pub seen_layer: u64,
}

impl Default for TipPose {
    fn default() -> Self {
        Self {
            time_ns: 0,
            tip_in_scene: Vector3::zeros(),
            direction: Vector3::z(),
            speed_along_m_per_s: 0.0,
            phase: Phase::Outside,
            punctured: false,
            held_travel_m: Vector3::zeros(),
            released_contact: 0,
            innermost_layer: 0,
            seen_layer: 0,
        }
    }
}

/// Tissue to haptic, each tissue tick.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct TissueResponse {
    pub time_ns: u64,
    pub tick: u64,
    /// Number of the contact that lasts; 0 for none.
    pub contact: u64,
    pub contact_in_scene: Vector3<f64>,
    /// r of eq. 6, kept for the whole contact.
    pub path_direction: Vector3<f64>,
    /// The innermost layer met, under a number that rises over the run, and where.
    pub layer: LayerKind,
    pub layer_number: u64,
    pub layer_in_scene: Vector3<f64>,
    /// What the body answers at the tip.
    pub local: LocalResponse,
    pub worst_residual: f64,
    pub worst_work_ns: u64,
    pub worst_wake_ns: u64,
    pub missed: u64,
    pub seed_count: u32,
    pub unsolved: bool,
}

impl TissueResponse {
    /// Where the tip meets tissue; means something while there is contact.
    pub fn touch(&self) -> Touch {
        Touch {
            contact_in_world: self.contact_in_scene,
            path_direction: self.path_direction,
            layer: self.layer,
            layer_number: self.layer_number,
            layer_in_world: self.layer_in_scene,
            local: self.local,
        }
    }
}

impl Default for TissueResponse {
    fn default() -> Self {
        Self {
            time_ns: 0,
            tick: 0,
            contact: 0,
            contact_in_scene: Vector3::zeros(),
            path_direction: Vector3::z(),
            layer: LayerKind::default(),
            layer_number: 0,
            layer_in_scene: Vector3::zeros(),
            local: LocalResponse::default(),
            worst_residual: 0.0,
            worst_work_ns: 0,
            worst_wake_ns: 0,
            missed: 0,
            seed_count: 0,
            unsolved: false,
        }
    }
}

/// Number that joins an order to the host's request; 0 when nobody waits.
pub type Ticket = u64;

/// Bridge to haptic.
// Copied through a ring: a box would be freed in the loop.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub enum HapticOrder {
    Parameters {
        ticket: Ticket,
        generation: u64,
        needle: NeedleParameters,
        force: ForceParameters,
    },
    Hand {
        ticket: Ticket,
        goal: HandGoal,
    },
    Engage {
        ticket: Ticket,
    },
    Disengage {
        ticket: Ticket,
    },
    Reset {
        ticket: Ticket,
    },
    /// Hand the flight recording over; the loop records anew once it has it back.
    HandOverTape,
    StopHand {
        ticket: Ticket,
    },
}

/// Bridge to tissue.
pub enum TissueOrder {
    Limits(Limits),
    DropSeed {
        ticket: Ticket,
    },
    UndoSeed {
        ticket: Ticket,
    },
    Reset,
    World {
        ticket: Ticket,
        world: Box<World>,
        tape: Box<TissueTape>,
    },
    /// Hand the flight recording over; the loop records anew once it has it back.
    HandOverTape,
}

/// Either loop to the bridge: what happened, once each.
#[derive(Clone, Copy, Debug)]
pub enum Notice {
    Done {
        ticket: Ticket,
        tick: u64,
    },
    Refused {
        ticket: Ticket,
        why: RefusalCode,
    },
    ParametersActive {
        ticket: Ticket,
        generation: u64,
        tick: u64,
    },
    Contact {
        tick: u64,
        time_ns: u64,
        position_m: Vector3<f64>,
    },
    Puncture {
        tick: u64,
        time_ns: u64,
        depth_m: f64,
        position_m: Vector3<f64>,
    },
    LeftTissue {
        tick: u64,
        time_ns: u64,
    },
    Seed {
        tick: u64,
        time_ns: u64,
        index: u32,
        position_m: Vector3<f64>,
    },
    Fault {
        tick: u64,
        time_ns: u64,
        fault: Fault,
    },
    Rearmed {
        tick: u64,
        time_ns: u64,
    },
    WorldSwapped {
        ticket: Ticket,
        generation: u64,
        tick: u64,
    },
}

/// Memory that the bridge loaned from shared memory for one snapshot.
pub struct SnapshotSlot {
    pub index: u32,
    pub scene_generation: u64,
    pub header: *mut SnapshotHeader,
    pub vertices: *mut Vertex,
    pub vertex_count: usize,
    /// Nodes of the displacement grid, behind the vertices.
    pub node_count: usize,
}

// SAFETY: the bridge keeps the loan alive and does not touch the memory until the slot comes back through the
// ring, so exactly one thread uses it at a time.
unsafe impl Send for SnapshotSlot {}

/// A slot that comes back.
pub struct SnapshotReturn {
    pub index: u32,
    /// False when the slot no longer fits the scene.
    pub filled: bool,
}

// SYNC: every ring and triple buffer is single-producer single-consumer; their crates pair release with acquire.
pub type RecordRing = rtrb::Producer<TickRecord>;
