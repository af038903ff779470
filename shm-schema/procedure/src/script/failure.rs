//! Reasons why a procedure cannot continue.

use super::{Procedure, WaitsFor};
use stylet_shm_schema::Fault;

impl Procedure {
    /// Re-arms after a fault that stands at the beginning; otherwise the procedure does not begin.
    #[must_use]
    pub fn rearming(self) -> Self {
        Self { rearms: true, ..self }
    }
}

/// Reason why the procedure cannot continue.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StepFailure {
    /// A condition did not come true in time.
    #[error("waited {limit_s:.1} s for {waits_for}{}", advice(.waits_for))]
    Waited {
        /// Missing condition.
        waits_for: WaitsFor,
        /// Time waited, s.
        limit_s: f64,
    },
    /// The force went off after it was turned on.
    #[error("the force is off: {}", .0.message())]
    ForceOff(Fault),
    /// A fault stood before the force was turned on, and re-arming was not requested.
    #[error("a fault keeps the force off, and only a person re-arms: {}", .0.message())]
    FaultStands(Fault),
    /// A request was refused.
    #[error("{request} was refused: {why}")]
    Refused {
        /// Name of the request.
        request: &'static str,
        /// The reasons, as text.
        why: String,
    },
}

fn advice(waits_for: &WaitsFor) -> &'static str {
    match waits_for {
        WaitsFor::Line => {
            "; rt-core prepares it in the background: leave it a free processor, or run with --tissue chainmail"
        }
        _ => "",
    }
}
