//! What happened, once each: contact, puncture, seeds, faults.

use crate::Text;
use bytemuck::{Pod, Zeroable};
use num_enum::TryFromPrimitive;

/// One thing that happened, written by the bridge.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Event {
    /// The run of the core.
    pub session_id: u64,
    /// Rises by one with each event of a run.
    pub sequence: u64,
    /// `CLOCK_MONOTONIC` when it happened.
    pub time_ns: u64,
    /// Tick of the loop that saw it; 0 when it was the bridge.
    pub tick: u64,
    /// [`EventKind`] by number.
    pub kind: u32,
    /// Seed index, fault number, 1 for a flight that was not saved, or nothing, by kind.
    pub code: u32,
    /// Depth, force, or nothing, by kind.
    pub value: f64,
    /// Where it happened, scene frame, m; zero for kinds without a place.
    pub position_m: [f64; 3],
    /// What a person reads; empty for most kinds.
    pub text: Text<128>,
}

/// By stable number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, TryFromPrimitive)]
#[repr(u32)]
pub enum EventKind {
    /// `value`: nothing.
    Contact = 1,
    /// `value`: depth in m.
    Puncture = 2,
    /// `code`: seed index.
    SeedDropped = 3,
    /// `value`: nothing.
    LeftTissue = 4,
    /// `code`: fault number.
    FaultRaised = 5,
    /// The force was armed again after a fault.
    Rearmed = 6,
    /// Another scene runs. `code`: its generation; `text`: its name.
    SceneLoaded = 7,
    /// Tissue, seeds and counters were reset.
    Reset = 8,
    /// An invalid message from a host was refused; `text` says why.
    InvalidRefused = 9,
    /// `text`: the file, or why none could be written.
    FlightSaved = 10,
    /// A moment that somebody marked, at its time. `text`: the words.
    Mark = 11,
    /// An instructor put a fault in. `code`: number of the [`crate::Exercise`]; `value`: factor or distance; `text`: its words.
    ExerciseBegun = 12,
    /// No fault of an instructor's is in force any more.
    ExercisesEnded = 13,
    /// The process that meets hosts was started anew. `text`: why.
    BridgeRestarted = 15,
    /// Whoever ordered a motion fell silent, and the motion was given up. `code`: 0 the needle's hand, 1 the second device's, 2 a
    /// needle that was drawn out; `text` says so.
    MotionGivenUp = 14,
    /// As [`FaultRaised`](Self::FaultRaised), of the second device; the needle's goes on.
    SecondFaultRaised = 20,
    /// The force of the second device was armed again after a fault.
    SecondRearmed = 21,
}

impl EventKind {
    /// `None` when this build does not know the number.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::try_from(number).ok()
    }
}
