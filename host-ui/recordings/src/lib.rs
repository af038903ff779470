//! Recordings of sessions (MCAP): their messages, and readers of them. Without ports: what a host receives from shared
//! memory has the same types.

#![warn(missing_docs)]

pub mod channels;
mod error;
mod gaps;
pub mod messages;
mod pieces;
mod played;
mod read;
pub mod stream;

pub use error::{FileProblem, RecordingError, ShowError};
pub use gaps::{Gap, Gaps};
pub use pieces::{Piece, Played, SceneModel, Snapshot};
pub use played::{played, played_of};
pub use read::{Recording, read};
