//! Orders and notices between the control thread and the loops, through wait-free rings.

use crate::rt::motion_lease::Promise;
use crate::rt::probe_tape::ProbeTape;
use crate::rt::tissue_tape::{LeftTape, TissueTape};
use crate::rt::world::World;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_hw::HandGoal;
use stylet_shm_schema::{Fault, HandMove, RefusalCode};
use stylet_sim::force::ForceParameters;
use stylet_sim::limits::Limits;
use stylet_sim::line::BodyLine;
use stylet_sim::migration::Migration;
use stylet_sim::needle::NeedleParameters;
use stylet_sim::probe::BodyProbe;

/// Number that links an order to the host's request; 0 if no answer is expected.
pub type Ticket = u64;

/// Orders from the control thread to a loop that owns a device. Each comes with a [`Ticket`].
// Copied through a ring: a box would be freed in the loop.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum HapticOrder {
    /// Use these parameters from this tick on.
    Parameters {
        /// Rises with each change of a run.
        generation: u64,
        /// The needle and its effect on tissue.
        needle: NeedleParameters,
        /// The terms of the force. The second device uses those of the gate.
        force: ForceParameters,
    },
    /// Move the simulated hand to a goal.
    Hand {
        /// Place, direction, speed and acceleration.
        goal: HandGoal,
        /// Direction of the tool's +y; `None`: the hand does not roll it.
        up: Option<Vector3<f64>>,
        /// Promise of the host; without one the motion needs no renewal.
        promise: Option<Promise>,
    },
    /// Hold the simulated hand where it is.
    StopHand,
    /// Turn the force on; re-arms after a fault.
    Engage,
    /// Ramp the force out.
    Disengage,
    /// End the contact, clear peaks and counters, and undo exercises.
    Reset,
    /// Renew what this host moves.
    KeepMoving(Promise),
    /// Hand the flight recording over; a new one begins once the tape is back.
    HandOverTape,
    /// To the needle alone, as all that follow. An exercise: treat the device as lost from this tick on, or restore it.
    LoseDevice(bool),
    /// An exercise: move the body to this offset from its place in the scene, scene frame, m, at the pace of a patient.
    MoveBody([f64; 3]),
    /// Leave the needle where it is.
    LeaveNeedle,
    /// Take a needle that stays in, by the number of its line.
    TakeNeedle(u64),
    /// Draw out a needle that stays in.
    DrawNeedle {
        /// Number of its line.
        number: u64,
        /// Speed of the needle.
        speed_m_per_s: f64,
        /// As for a goal.
        promise: Option<Promise>,
    },
    /// The loop made no tick within the supervisor's patience: the force stays off until the operator re-arms.
    StoodStill,
}

/// Returns the order to move a hand.
pub fn hand_order(hand: &HandMove, up: Option<[f64; 3]>, promise: Option<Promise>) -> HapticOrder {
    HapticOrder::Hand {
        goal: HandGoal {
            tip_in_world: hand.tip_m.into(),
            direction: hand.direction.into(),
            speed_m_per_s: hand.speed_m_per_s,
            acceleration_m_per_s2: hand.acceleration_m_per_s2,
        },
        up: up.map(Vector3::from),
        promise,
    }
}

/// Orders to the tissue loop that a flight recording repeats unchanged.
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

/// Orders from the control thread to the tissue loop.
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
    /// The force was turned on: restart the totals since then.
    Armed,
    /// Hand the flight recording over; a new one begins once the tape is back.
    HandOverTape,
    /// Room to record the loads of needles that stay in.
    LeftRoom(Box<LeftTape>),
    /// Columns for a needle that enters along their line; the force loop gets its half separately.
    Line(Box<BodyLine>),
    /// The ultrasound probe of a scene; ignored in another.
    Probe {
        /// Generation of the scene.
        generation: u64,
        /// Its answers.
        probe: Box<BodyProbe>,
        /// Room to record it.
        room: Box<ProbeTape>,
    },
}

/// Report of a loop to the control thread.
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
    /// Something happened, once.
    Event {
        /// Tick of the loop, from 1.
        tick: u64,
        /// `CLOCK_MONOTONIC`, ns.
        time_ns: u64,
        /// The event.
        what: Happened,
    },
}

impl Notice {
    /// Returns the answer to an order of that tick.
    pub fn answer(ticket: Ticket, tick: u64, result: Result<(), RefusalCode>) -> Self {
        match result {
            Ok(()) => Self::Done { ticket, tick },
            Err(why) => Self::Refused { ticket, why },
        }
    }
}

/// Events in a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Happened {
    /// The tip has met the body at this place, scene frame, m.
    Contact(Vector3<f64>),
    /// A membrane gave way.
    Puncture {
        /// Depth of the tip behind the membrane at rest, m.
        depth_m: f64,
        /// Place of the tip, scene frame, m.
        position_m: Vector3<f64>,
    },
    /// The tip has left the body.
    LeftTissue,
    /// A seed was dropped.
    Seed {
        /// Number of the seed, from 0.
        index: u32,
        /// Place of the tip, scene frame, m.
        position_m: Vector3<f64>,
    },
    /// The first fault since the force was armed.
    Fault(Fault),
    /// The force was armed again after a fault.
    Rearmed,
    /// The host that ordered a motion fell silent, and the motion of this was given up.
    MotionGivenUp(Moved),
}

/// Objects that hosts move, by stable number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moved {
    /// The hand that holds the needle.
    Needle = 0,
    /// The hand of the second device.
    SecondHand = 1,
    /// A needle that stayed in.
    DrawnNeedle = 2,
}
