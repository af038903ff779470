//! How a run of needles ends.

use stylet_host::link::LinkError;
use stylet_procedure::{Step, StepFailure};

/// How a run ended, or that it has not.
#[derive(Clone, Debug, PartialEq)]
pub enum RunStatus {
    /// Not done yet.
    Working,
    /// Every step was completed.
    Done,
    /// A step could not be completed; nothing more is sent.
    Failed(RunError),
}

/// The step that could not be completed, and why.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("step \"{}\" failed: {why}", step.name())]
pub struct RunError {
    /// The step at that time.
    pub step: Step,
    /// What went wrong.
    pub why: RunFailure,
}

impl RunError {
    /// Whether it did not begin since a fault stands.
    pub fn is_standing_fault(&self) -> bool {
        matches!(self.why, RunFailure::Procedure(StepFailure::FaultStands(_)))
    }
}

/// Why a step could not be completed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RunFailure {
    /// The core is absent; the text says what to do.
    #[error("{0}")]
    Absent(String),
    /// Another run of the core has begun.
    #[error("rt-core was restarted during the procedure; start the procedure again")]
    Restarted,
    /// The program was not heard, and the core stopped what it moved.
    #[error("this program stood still for {0:.1} s, and the core stopped the needle; continue when you are ready")]
    StoodStill(f64),
    /// A request could not be sent.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The procedure itself cannot go on.
    #[error(transparent)]
    Procedure(#[from] StepFailure),
}
