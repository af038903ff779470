//! Errors of using a recording.

use std::path::{Path, PathBuf};
use stylet_base::input::InputError;

/// Failure to use the file of a recording, which the text names.
#[derive(Debug, thiserror::Error)]
#[error("{}: {why}", path.display())]
pub struct RecordingError {
    path: PathBuf,
    why: FileProblem,
}

impl RecordingError {
    /// Returns an error about a file.
    pub fn new(path: &Path, why: impl Into<FileProblem>) -> Self {
        Self {
            path: path.to_owned(),
            why: why.into(),
        }
    }
}

/// Problem with the file of a recording.
#[derive(Debug, thiserror::Error)]
pub enum FileProblem {
    /// It cannot be created.
    #[error("{0}; choose another file with --out")]
    Create(std::io::Error),
    /// It cannot be read at all.
    #[error(transparent)]
    Io(std::io::Error),
    /// It cannot be read to be shown.
    #[error(transparent)]
    Read(#[from] InputError),
    /// It cannot be written.
    #[error(transparent)]
    Write(#[from] mcap::McapError),
    /// It is not a recording.
    #[error(transparent)]
    Show(#[from] ShowError),
    /// It holds no tick.
    #[error("holds no tick of Stylet")]
    NoTick,
    /// It holds no tick of a second device.
    #[error("the recording holds no tick of a second device: it is of a run without --device-2")]
    NoSecond,
}

/// Reason why the bytes of a recording cannot be shown; the text follows the name of the file.
#[derive(Debug, thiserror::Error)]
pub enum ShowError {
    /// Another kind of file.
    #[error("it is no recording of host-ui record (not an MCAP file)")]
    NotMcap,
    /// An earlier version recorded it.
    #[error("it holds no scene: an earlier version recorded it; record it again to look at it")]
    NoScene,
    /// Nothing usable precedes the damage.
    #[error("{0}")]
    Damaged(String),
}
