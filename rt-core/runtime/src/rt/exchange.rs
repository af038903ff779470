//! What the bridge and the loops hand each other: orders, notices and snapshot slots, through wait-free rings.

use crate::rt::tissue_tape::TissueTape;
use crate::rt::world::World;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_hw::HandGoal;
use stylet_shm_schema::{Fault, RefusalCode, SnapshotHeader, Vertex};
use stylet_sim::force::ForceParameters;
use stylet_sim::limits::Limits;
use stylet_sim::needle::NeedleParameters;

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
