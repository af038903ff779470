//! Errors of recording a session and of using a recording.

use crate::link::LinkError;
use std::path::Path;
use stylet_base::WriteError;
use stylet_base::interrupt::InterruptError;
use stylet_recordings::{FileProblem, RecordingError};
use stylet_shm_schema::Refusal;

/// Failure to record a session or to use a recording; each text says what to do if there is a remedy.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// A duration or a rate beyond its limits.
    #[error("--duration needs seconds above 0, --snapshot-rate 0 to 60 Hz")]
    Options,
    /// Neither a file nor viewers.
    #[error("give --out or --live for the session")]
    NoDestination,
    /// A core was found that does not answer.
    #[error("rt-core runs but does not answer; end it and start it again")]
    NoAnswer,
    /// There is no core, or a request could not be sent.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The core refused to save its flight recording; the text says why.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The core did not do what it accepted.
    #[error("the core did not write its flight recording in time")]
    NoFlight,
    /// The signals that end a recording cannot be handled.
    #[error(transparent)]
    Signals(#[from] InterruptError),
    /// The recording lacks ticks or events.
    #[error(
        "{ticks} ticks are missing in {gaps} gaps, {in_core} of them lost in the core; {events} events are missing. \
         The file says which; a faster disk, or fewer programs beside this one, lose none"
    )]
    Missing {
        /// Missing ticks.
        ticks: u64,
        /// Gaps in the ticks.
        gaps: usize,
        /// Ticks that never left the core.
        in_core: u64,
        /// Missing events.
        events: u64,
    },
    /// A file cannot be created, read or written.
    #[error(transparent)]
    File(#[from] RecordingError),
    /// The program that serves viewers cannot be started.
    #[error("stylet-live: cannot be started ({0}): 'make live' builds it; it belongs beside host-ui")]
    NoLive(std::io::Error),
    /// The program that serves viewers has no input.
    #[error("stylet-live: it has no input")]
    LiveInput,
    /// The program that serves viewers reads no more.
    #[error("stylet-live: it ended, or reads no more: {0}")]
    LiveEnded(mcap::McapError),
    /// An exported file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl RecordError {
    /// Returns an error about a file, which it names.
    pub(super) fn of_file(path: &Path, why: impl Into<FileProblem>) -> Self {
        RecordingError::new(path, why).into()
    }
}
