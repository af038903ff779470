//! Reasons why a headless procedure ends early.

use crate::plan::{PlanError, RehearsalError};
use crate::score::ScoreError;
use crate::workflow::RunError;
use std::path::PathBuf;
use stylet_base::WriteError;
use stylet_host::link::LinkError;

/// Reason why a procedure ends early; the text gives the remedy if there is one.
#[derive(Debug, thiserror::Error)]
pub enum ProcedureError {
    /// The user ended it.
    #[error("interrupted")]
    Interrupted,
    /// No core was found, or it does not answer; the text says what to do.
    #[error("{0}")]
    NoCore(String),
    /// The core cannot be started.
    #[error("{} cannot be started ({why}); check --core", path.display())]
    CoreNotStarted {
        /// The program.
        path: PathBuf,
        /// What the system reported.
        why: std::io::Error,
    },
    /// The core that was started has ended.
    #[error("the rt-core that was started has ended ({0}); see its message above")]
    CoreEnded(std::process::ExitStatus),
    /// The core refused the scene; the text says why.
    #[error("the core refused the scene: {0}")]
    SceneRefused(String),
    /// The core refused parameters; the text says why.
    #[error("the core refused the parameters: {0}")]
    ParametersRefused(String),
    /// The core did not send data that the procedure needs.
    #[error("{0}")]
    NothingReceived(&'static str),
    /// A file of the scene, the plan's seeds or the source cannot be used; the text names it.
    #[error("{0}")]
    Input(String),
    /// A request could not be sent.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The plan cannot be used.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A needle could not be rehearsed.
    #[error(transparent)]
    Rehearsal(#[from] RehearsalError),
    /// A step could not be completed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A fault stands, and re-arming was not requested.
    #[error("{0}. See to its cause, then re-arm in the window (key E), or give --rearm")]
    FaultStands(RunError),
    /// The implant cannot be scored.
    #[error(transparent)]
    Score(#[from] ScoreError),
    /// The folder of the results cannot be created.
    #[error("{} cannot be written ({why}); choose another folder with --out", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What the system reported.
        why: std::io::Error,
    },
    /// A result cannot be represented in JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A file of the results cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}
