//! What a host may ask for, and the answer it gets.

use crate::Text;
use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// A plan of 128 seeds and its path fits.
pub const MAX_COMMAND_VALUES: usize = 400;

/// A request. Answered by one [`Reply`] with the same `host_id` and `command_id`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.Command")]
pub struct Command {
    pub host_id: u64,
    pub command_id: u64,
    /// [`CommandKind`] by number.
    pub kind: u32,
    /// How many of `values` count.
    pub value_count: u32,
    pub values: [f64; MAX_COMMAND_VALUES],
}

impl Command {
    /// `values` past [`MAX_COMMAND_VALUES`] are not sent.
    pub fn new(host_id: u64, command_id: u64, kind: CommandKind, values: &[f64]) -> Self {
        let mut command = Self::zeroed();
        command.host_id = host_id;
        command.command_id = command_id;
        command.kind = kind as u32;
        let count = values.len().min(MAX_COMMAND_VALUES);
        command.value_count = count as u32;
        command.values[..count].copy_from_slice(&values[..count]);
        command
    }
}

/// By stable number; behind each, its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum CommandKind {
    /// Pairs of parameter number and value in SI; all take effect at one tick, or none.
    SetParameters = 1,
    /// Entry x y z (m), direction x y z, then x y z (m) of each seed. An empty list withdraws the plan.
    SetPlan = 2,
    /// Tip goal x y z (m), direction x y z, speed (m/s), acceleration (m/s^2) for the simulated hand.
    MoveHand = 3,
    /// Leave a seed at the tip.
    DropSeed = 4,
    /// Turn the force on; also re-arms after a fault.
    Engage = 5,
    /// Ramp the force to zero.
    Disengage = 6,
    /// Tissue to rest, seeds removed, peaks and worst cases forgotten.
    Reset = 7,
    /// Run a built-in scene: its place in [`crate::BUILTIN_SCENES`]; the first one without a value.
    LoadBuiltinScene = 8,
    /// Remove the last seed.
    UndoSeed = 9,
    /// End `rt-core`.
    Shutdown = 10,
    /// Write the flight recording of both loops to disk.
    SaveFlight = 11,
    /// Go through one needle ahead of time, in a body of its own, from rest, and send a [`crate::Rehearsal`] before the reply.
    /// Entry x y z (m), direction x y z, speeds of insertion, retraction and approach (m/s), acceleration (m/s^2), how far from the
    /// entry the tip is drawn back to (m), then x y z (m) of each drop in its order.
    Rehearse = 12,
    /// The simulated hand stops as fast as it can; where that is only the core knows.
    StopHand = 13,
}

impl CommandKind {
    pub fn from_number(number: u32) -> Option<Self> {
        [
            Self::SetParameters,
            Self::SetPlan,
            Self::MoveHand,
            Self::DropSeed,
            Self::Engage,
            Self::Disengage,
            Self::Reset,
            Self::LoadBuiltinScene,
            Self::UndoSeed,
            Self::Shutdown,
            Self::SaveFlight,
            Self::Rehearse,
            Self::StopHand,
        ]
        .into_iter()
        .find(|k| *k as u32 == number)
    }
}

/// The answer to a command or an upload.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.Reply")]
pub struct Reply {
    pub session_id: u64,
    pub host_id: u64,
    pub command_id: u64,
    /// First tick of the force loop that ran with the change.
    pub effective_tick: u64,
    /// [`ReplyStatus`] by number.
    pub status: u32,
    pub reserved: u32,
    /// Every reason for a refusal, one a line; empty when accepted.
    pub text: Text<1024>,
}

/// By stable number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum ReplyStatus {
    Accepted = 1,
    Refused = 2,
}

impl ReplyStatus {
    pub fn from_number(number: u32) -> Option<Self> {
        [Self::Accepted, Self::Refused]
            .into_iter()
            .find(|s| *s as u32 == number)
    }
}
