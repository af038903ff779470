//! End of a run of needles.

use stylet_host::link::LinkError;
use stylet_procedure::{Step, StepFailure};

/// State of a run.
#[derive(Clone, Debug, PartialEq)]
pub enum RunStatus {
    /// The run continues.
    Working,
    /// Every step was completed.
    Done,
    /// A step could not be completed; nothing more is sent.
    Failed(RunError),
}

/// Step that could not be completed, with the reason.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("step \"{}\" failed: {why}", step.name())]
pub struct RunError {
    /// The step at that time.
    pub step: Step,
    /// Reason.
    pub why: RunFailure,
}

impl RunError {
    /// Returns whether it did not begin because a fault stands.
    pub fn is_standing_fault(&self) -> bool {
        matches!(self.why, RunFailure::Procedure(StepFailure::FaultStands(_)))
    }
}

/// Reason why a step could not be completed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RunFailure {
    /// Another run of the core has begun.
    #[error("rt-core was restarted during the procedure; start the procedure again")]
    Restarted,
    /// The program was silent, and the core stopped its motion.
    #[error("this program stood still for {0:.1} s, and the core stopped the needle; continue when you are ready")]
    StoodStill(f64),
    /// There is no core, or a request could not be sent.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The procedure itself cannot continue.
    #[error(transparent)]
    Procedure(#[from] StepFailure),
}
