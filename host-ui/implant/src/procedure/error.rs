//! Reasons why a headless procedure ends early.

use crate::plan::{PlanError, RehearsalError};
use crate::provenance::DigestError;
use crate::score::ScoreError;
use crate::workflow::RunError;
use std::path::PathBuf;
use stylet_base::WriteError;
use stylet_base::interrupt::InterruptError;
use stylet_base::output::OutputError;
use stylet_dose::DoseError;
use stylet_files::FileError;
use stylet_host::link::LinkError;
use stylet_shm_schema::{MAX_SEEDS, Refusal};

/// Reason why a procedure ends early; the text gives the remedy if there is one.
#[derive(Debug, thiserror::Error)]
pub enum ProcedureError {
    /// A speed beyond its limits.
    #[error("--insert-speed {0}: give 0.1 to 500 mm/s")]
    InsertSpeed(f64),
    /// The user ended it.
    #[error("interrupted")]
    Interrupted,
    /// No core was found, for this reason.
    #[error("{0}, or add --core PATH to have it started")]
    NoCore(String),
    /// A core was found that does not answer.
    #[error("rt-core runs but does not answer; end it and start it again")]
    NoAnswer,
    /// The core that was started does not answer.
    #[error("the rt-core that was started does not answer")]
    NoAnswerOfStarted,
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
    /// The core refused the scene.
    #[error("the core refused the scene: {0}")]
    SceneRefused(Refusal),
    /// The core refused parameters.
    #[error("the core refused the parameters: {0}")]
    ParametersRefused(Refusal),
    /// The core did not send data that the procedure needs.
    #[error("{0}")]
    NothingReceived(&'static str),
    /// A file of the scene or the source cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file of the inputs cannot be read again.
    #[error(transparent)]
    Digest(#[from] DigestError),
    /// The folder of the results cannot be used.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The signals that end a program cannot be received.
    #[error(transparent)]
    Signals(#[from] InterruptError),
    /// The source of the plan is unknown.
    #[error("{0}; give --source FILE")]
    UnknownSource(DoseError),
    /// The source is of another isotope than the plan's.
    #[error(
        "{}: it is {} and the plan is for {} (model \"{}\"); leave --source out, or choose one of that isotope",
        .path.display(), .isotope, .planned, .model
    )]
    OtherIsotope {
        /// File of the source.
        path: PathBuf,
        /// Its isotope.
        isotope: String,
        /// Isotope of the plan.
        planned: String,
        /// Model of the plan's source.
        model: String,
    },
    /// A plan without seeds, or with more than the core takes.
    #[error("{}: {seeds} seeds; 1 to {MAX_SEEDS} can be placed", .path.display())]
    SeedCount {
        /// File of the plan.
        path: PathBuf,
        /// Its seeds.
        seeds: usize,
    },
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
    #[error("{0}. Remove its cause, then re-arm in the window (key E), or give --rearm")]
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
