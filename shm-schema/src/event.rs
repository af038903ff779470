//! What happened, once each: contact, puncture, seeds, faults.

use crate::Text;
use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.Event")]
pub struct Event {
    pub session_id: u64,
    pub sequence: u64,
    pub time_ns: u64,
    pub tick: u64,
    /// [`EventKind`] by number.
    pub kind: u32,
    /// Seed index, fault number, 1 for a flight that was not saved, or nothing, by kind.
    pub code: u32,
    /// Depth, force, or nothing, by kind.
    pub value: f64,
    pub position_m: [f64; 3],
    pub text: Text<128>,
}

/// By stable number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    Rearmed = 6,
    SceneLoaded = 7,
    Reset = 8,
    /// A message from shared memory was not believed; `text` says why.
    RubbishRefused = 9,
    /// `text`: the file, or why none could be written.
    FlightSaved = 10,
}

impl EventKind {
    pub fn from_number(number: u32) -> Option<Self> {
        [
            Self::Contact,
            Self::Puncture,
            Self::SeedDropped,
            Self::LeftTissue,
            Self::FaultRaised,
            Self::Rearmed,
            Self::SceneLoaded,
            Self::Reset,
            Self::RubbishRefused,
            Self::FlightSaved,
        ]
        .into_iter()
        .find(|k| *k as u32 == number)
    }
}
