//! Events of a run, once each: contact, puncture, seeds, faults.

use crate::Text;
use bytemuck::{Pod, Zeroable};
use num_enum::TryFromPrimitive;
use serde::{Deserialize, Serialize};

/// One event, written by the bridge.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, Serialize, Deserialize)]
pub struct Event {
    /// The run of the core.
    pub session_id: u64,
    /// Rises by one with each event of a run.
    pub sequence: u64,
    /// Time of the event, `CLOCK_MONOTONIC`.
    pub time_ns: u64,
    /// Tick of the loop that saw it; 0 if the bridge did.
    pub tick: u64,
    /// [`EventKind`] by number.
    #[serde(skip)]
    pub kind: u32,
    /// Seed index, fault number, 1 for a flight that was not saved, or unused, by kind.
    pub code: u32,
    /// Depth, force, or unused, by kind.
    pub value: f64,
    /// Position of the event, scene frame, m; zero for kinds without one.
    pub position_m: [f64; 3],
    /// Text for people; empty for most kinds.
    pub text: Text<128>,
}

/// Kind of event by stable number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, TryFromPrimitive)]
#[repr(u32)]
pub enum EventKind {
    /// `value`: unused.
    Contact = 1,
    /// `value`: depth in m.
    Puncture = 2,
    /// `code`: seed index.
    SeedDropped = 3,
    /// `value`: unused.
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
    /// A moment that was marked, at its time. `text`: the words.
    Mark = 11,
    /// An instructor injected a fault. `code`: number of the [`crate::Exercise`]; `value`: factor or distance; `text`:
    /// its words.
    ExerciseBegun = 12,
    /// No instructor-injected fault is in force any longer.
    ExercisesEnded = 13,
    /// The bridge was restarted. `text`: why.
    BridgeRestarted = 15,
    /// The host that ordered a motion fell silent, and the motion was given up. `code`: 0 the needle's hand, 1 the
    /// second device's, 2 a needle that was drawn out; `text` says so.
    MotionGivenUp = 14,
    /// As [`FaultRaised`](Self::FaultRaised), for the second device; the needle's continues.
    SecondFaultRaised = 20,
    /// The force of the second device was armed again after a fault.
    SecondRearmed = 21,
}

numbered!(EventKind);
