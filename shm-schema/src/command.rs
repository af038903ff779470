//! The records of a request and of its answer in shared memory.

use crate::{Reason, Refusal, Text};
use bytemuck::{Pod, Zeroable};
use num_enum::TryFromPrimitive;

/// Size of the payload of a command, bytes. The longest is a rehearsal with the most needles and seeds.
pub const COMMAND_BYTES: usize = 5760;

/// Longest text of a mark, bytes.
pub const MARK_BYTES: usize = 96;

/// A [`crate::Request`] as plain old data, written by a host. Answered by one [`Reply`] with the same `host_id` and
/// `command_id`. Made and read by [`crate::Request::encode`] and [`crate::Request::decode`] only.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Command {
    /// The requesting host.
    pub host_id: u64,
    /// Number of the command, assigned by the host.
    pub command_id: u64,
    /// [`crate::CommandKind`] by number.
    pub kind: u32,
    /// Bytes of `payload` in use.
    pub length: u32,
    /// The request, encoded by `postcard`.
    pub payload: [u8; COMMAND_BYTES],
}

/// Most reasons in one reply; a refusal with more names the rest in its text only.
pub const MAX_REASONS: usize = 48;

/// The answer to a command or an upload, written by the bridge.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Reply {
    /// The run of the answering core.
    pub session_id: u64,
    /// The requesting host.
    pub host_id: u64,
    /// Its number for the command.
    pub command_id: u64,
    /// First tick of the force loop that ran with the change. For parameters, this holds for needle and force; the
    /// limits of the tissue were ordered together with them and hold from the next tick of the tissue loop on.
    pub effective_tick: u64,
    /// [`ReplyStatus`] by number.
    pub status: u32,
    /// Number of `reasons` in use; 0 if accepted.
    pub reason_count: u32,
    /// Reasons of the refusal, for programs.
    pub reasons: [Reason; MAX_REASONS],
    /// All reasons of the refusal, for people, one per line; empty if accepted.
    pub text: Text<1024>,
}

impl Reply {
    /// Returns an answer to command `command_id` of host `host_id`.
    pub fn new(session_id: u64, (host_id, command_id): (u64, u64), result: Result<u64, &Refusal>) -> Self {
        let mut reply = Self::zeroed();
        (reply.session_id, reply.host_id, reply.command_id) = (session_id, host_id, command_id);
        match result {
            Ok(effective_tick) => (reply.status, reply.effective_tick) = (ReplyStatus::Accepted as u32, effective_tick),
            Err(refusal) => {
                reply.status = ReplyStatus::Refused as u32;
                reply.text = Text::new(&refusal.text);
                reply.reason_count = refusal.reasons.len().min(MAX_REASONS) as u32;
                for (slot, reason) in reply.reasons.iter_mut().zip(&refusal.reasons) {
                    *slot = *reason;
                }
            }
        }
        reply
    }

    /// Returns the reasons in use.
    pub fn reasons(&self) -> &[Reason] {
        &self.reasons[..(self.reason_count as usize).min(MAX_REASONS)]
    }
}

/// Result of a request, by stable number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, TryFromPrimitive)]
#[repr(u32)]
pub enum ReplyStatus {
    /// It was carried out.
    Accepted = 1,
    /// Nothing changed.
    Refused = 2,
}

numbered!(ReplyStatus);
