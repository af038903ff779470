//! What the control thread and the loops hand each other: orders and notices, through wait-free rings.

use crate::rt::motion_lease::Promise;
use crate::rt::probe_tape::ProbeTape;
use crate::rt::tissue_tape::{LeftTape, TissueTape};
use crate::rt::world::World;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_hw::HandGoal;
use stylet_shm_schema::{Fault, RefusalCode};
use stylet_sim::force::ForceParameters;
use stylet_sim::limits::Limits;
use stylet_sim::line::BodyLine;
use stylet_sim::migration::Migration;
use stylet_sim::needle::NeedleParameters;
use stylet_sim::probe::BodyProbe;

/// Number that joins an order to the host's request; 0 when nobody waits for an answer.
pub type Ticket = u64;

/// Control thread to haptic.
// Copied through a ring: a box would be freed in the loop.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub enum HapticOrder {
    /// Use these parameters from this tick on.
    Parameters {
        /// Number of the request.
        ticket: Ticket,
        /// Rises with each change of a run.
        generation: u64,
        /// The needle and what it does to tissue.
        needle: NeedleParameters,
        /// The terms of the force.
        force: ForceParameters,
    },
    /// Bring the simulated hand to a goal.
    Hand {
        /// Number of the request.
        ticket: Ticket,
        /// Place, direction, speed and acceleration.
        goal: HandGoal,
        /// Of the host; without one nobody has to renew it.
        promise: Option<Promise>,
    },
    /// Turn the force on; re-arms after a fault.
    Engage {
        /// Number of the request.
        ticket: Ticket,
    },
    /// Ramp the force out.
    Disengage {
        /// Number of the request.
        ticket: Ticket,
    },
    /// An exercise: the device counts as lost, or no longer.
    LoseDevice {
        /// Number of the request.
        ticket: Ticket,
        /// From this tick on.
        lost: bool,
    },
    /// An exercise: the body moves there, from where the scene has it, scene frame, m.
    MoveBody {
        /// Number of the request.
        ticket: Ticket,
        /// At the pace of a patient.
        to_m: [f64; 3],
    },
    /// End the contact and clear peaks and counters, and take out what exercises put in.
    Reset {
        /// Number of the request.
        ticket: Ticket,
    },
    /// Leave the needle where it is.
    LeaveNeedle {
        /// Number of the request.
        ticket: Ticket,
    },
    /// Take up a needle that stays in.
    TakeNeedle {
        /// Number of the request.
        ticket: Ticket,
        /// Number of its line.
        number: u64,
    },
    /// Draw out a needle that stays in.
    DrawNeedle {
        /// Number of the request.
        ticket: Ticket,
        /// Number of its line.
        number: u64,
        /// How fast.
        speed_m_per_s: f64,
        /// As of a goal.
        promise: Option<Promise>,
    },
    /// What this host moves goes on.
    KeepMoving(Promise),
    /// The loop made no tick for longer than the supervisor waits: the force stays off until somebody re-arms.
    StoodStill,
    /// Hand the flight recording over; the loop records anew once it has it back.
    HandOverTape,
    /// Hold the simulated hand where it is.
    StopHand {
        /// Number of the request.
        ticket: Ticket,
    },
}

/// Orders to the tissue loop that a flight recording repeats as they were.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum TissueStep {
    /// Use these parameters from this tick on.
    Parameters {
        /// Limits of the links.
        limits: Limits,
        /// Migration of seeds.
        migration: Migration,
    },
    /// Leave a seed at the tip.
    DropSeed {
        /// As in the request.
        strand_pitch_m: Option<f64>,
    },
    /// Remove the seed that was dropped last.
    UndoSeed,
    /// Return the tissue to rest and remove every seed.
    Reset,
}

/// Control thread to tissue.
pub enum TissueOrder {
    /// Carry out one step; answered under the ticket.
    Step(Ticket, TissueStep),
    /// Run another scene from this tick on.
    World {
        /// Number of the request.
        ticket: Ticket,
        /// The scene with its tissue at rest.
        world: Box<World>,
        /// A blank flight recording for it.
        tape: Box<TissueTape>,
    },
    /// The force was turned on: totals since then begin anew.
    Armed,
    /// Hand the flight recording over; the loop records anew once it has it back.
    HandOverTape,
    /// Room to record what needles that stay in do to the body.
    LeftRoom(Box<LeftTape>),
    /// Columns for a needle that goes in where they were made; the force loop gets its half beside them.
    Line(Box<BodyLine>),
    /// The ultrasound probe of a scene: of no use to another.
    Probe {
        /// Of the scene.
        generation: u64,
        /// What it can press.
        probe: Box<BodyProbe>,
        /// Room to record it.
        room: Box<ProbeTape>,
    },
}

/// Either loop to the control thread: what happened, once each.
#[derive(Clone, Copy, Debug)]
pub enum Notice {
    /// An order was carried out.
    Done {
        /// Number of the request.
        ticket: Ticket,
        /// Tick of the loop, from 1.
        tick: u64,
    },
    /// An order was refused.
    Refused {
        /// Number of the request.
        ticket: Ticket,
        /// The loop's reason.
        why: RefusalCode,
    },
    /// Parameters are in use.
    ParametersActive {
        /// Number of the request.
        ticket: Ticket,
        /// Rises with each change of a run.
        generation: u64,
        /// Tick of the loop, from 1.
        tick: u64,
    },
    /// The tip has met the body.
    Contact {
        /// Tick of the loop, from 1.
        tick: u64,
        /// `CLOCK_MONOTONIC`, ns.
        time_ns: u64,
        /// Place of the tip, scene frame, m.
        position_m: Vector3<f64>,
    },
    /// A membrane gave way.
    Puncture {
        /// Tick of the loop, from 1.
        tick: u64,
        /// `CLOCK_MONOTONIC`, ns.
        time_ns: u64,
        /// Depth of the tip behind the membrane at rest, m.
        depth_m: f64,
        /// Place of the tip, scene frame, m.
        position_m: Vector3<f64>,
    },
    /// The tip has left the body.
    LeftTissue {
        /// Tick of the loop, from 1.
        tick: u64,
        /// `CLOCK_MONOTONIC`, ns.
        time_ns: u64,
    },
    /// A seed was dropped.
    Seed {
        /// Tick of the loop, from 1.
        tick: u64,
        /// `CLOCK_MONOTONIC`, ns.
        time_ns: u64,
        /// Number of the seed, from 0.
        index: u32,
        /// Place of the tip, scene frame, m.
        position_m: Vector3<f64>,
    },
    /// The first fault since the force was armed.
    Fault {
        /// Tick of the loop, from 1.
        tick: u64,
        /// `CLOCK_MONOTONIC`, ns.
        time_ns: u64,
        /// The cause.
        fault: Fault,
    },
    /// The force was armed again after a fault.
    Rearmed {
        /// Tick of the loop, from 1.
        tick: u64,
        /// `CLOCK_MONOTONIC`, ns.
        time_ns: u64,
    },
    /// Whoever ordered a motion fell silent, and the motion was given up.
    MotionGivenUp {
        /// Tick of the loop, from 1.
        tick: u64,
        /// `CLOCK_MONOTONIC`, ns.
        time_ns: u64,
        /// What moved.
        what: Moved,
    },
    /// Another scene runs.
    WorldSwapped {
        /// Number of the request.
        ticket: Ticket,
        /// Rises with each change of a run.
        generation: u64,
        /// Tick of the loop, from 1.
        tick: u64,
    },
}

/// What hosts move, by stable number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moved {
    /// The hand that holds the needle.
    Needle = 0,
    /// That of the second device.
    SecondHand = 1,
    /// A needle that stayed in.
    DrawnNeedle = 2,
}
