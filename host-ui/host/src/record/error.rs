//! Errors of recording a session and of using a recording.

use crate::link::LinkError;
use std::path::{Path, PathBuf};
use stylet_base::WriteError;
use stylet_base::input::InputError;
use stylet_base::interrupt::InterruptError;
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
    #[error("{}: {why}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Problem with the file.
        why: FileProblem,
    },
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

impl RecordError {
    /// Returns an error about a file, which it names.
    pub(super) fn of_file(path: &Path, why: impl Into<FileProblem>) -> Self {
        Self::File {
            path: path.to_owned(),
            why: why.into(),
        }
    }
}
