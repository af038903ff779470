//! A host's view of the core, in its own types.

use std::time::Duration;
use stylet_shm_schema::{Refusal, Reply, ReplyStatus};

pub use stylet_recordings::{SceneModel, Snapshot};

/// Status of the core.
#[derive(Clone, Debug, PartialEq)]
pub enum LinkStatus {
    /// No core has announced itself, or it has been silent for long; `why` says what to do.
    Absent {
        /// Instructions for the user.
        why: String,
    },
    /// The heartbeat moves.
    Live,
    /// The heartbeat has not moved.
    Silent {
        /// Time since the last heartbeat.
        since: Duration,
    },
}

impl Default for LinkStatus {
    fn default() -> Self {
        Self::Absent { why: String::new() }
    }
}

/// The core's answer to a command or an upload: the first tick of the force loop that ran with the change.
pub type Answer = Result<u64, Refusal>;

/// Decodes an answer; `None` if it is inconsistent.
pub(super) fn answer_of(reply: &Reply) -> Option<Answer> {
    Some(match ReplyStatus::from_number(reply.status)? {
        ReplyStatus::Accepted => Ok(reply.effective_tick),
        _ => Err(Refusal {
            reasons: reply.reasons().to_vec(),
            text: reply.text.read(),
        }),
    })
}

/// Reason why something could not be sent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LinkError {
    /// There is no core, for this reason.
    #[error("{0}")]
    Absent(String),
    /// The request itself is wrong.
    #[error(transparent)]
    Request(#[from] Refusal),
    /// A volume of another size than its header says, or of more cells than can be sent.
    #[error("the volume has {cells} cells; it must have {expected} for its size, and 1 to {most} can be sent")]
    Volume {
        /// Cells of the volume.
        cells: usize,
        /// Cells for its size.
        expected: usize,
        /// Most cells that can be sent.
        most: usize,
    },
    /// The queue is full.
    #[error("too many requests wait to be sent to rt-core; try again")]
    Busy,
    /// A recording takes the place of a core.
    #[error("a recording is shown; close it first")]
    Playback,
}
