//! Reasons why a procedure cannot continue.

use super::Procedure;
use stylet_shm_schema::Fault;

impl Procedure {
    /// Re-arms after a fault that stands at the beginning; otherwise the procedure does not begin.
    #[must_use]
    pub fn rearming(self) -> Self {
        Self { rearms: true, ..self }
    }
}

/// Reason why the procedure cannot continue. Times are those waited, s.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StepFailure {
    /// The force loop shows no state.
    #[error("waited {0:.1} s for the state of the force loop")]
    NoState(f64),
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
    /// A request was not answered.
    #[error("waited {1:.1} s for a reply to {0}")]
    NoReply(&'static str, f64),
    /// A request was accepted without effect.
    #[error("waited {1:.1} s for {0} to take effect")]
    NoEffect(&'static str, f64),
    /// A seed was dropped but is not in the tissue.
    #[error("waited {0:.1} s for the seed in the tissue")]
    NoSeed(f64),
    /// A needle was not left in the tissue, or not drawn out of it.
    #[error("waited {0:.0} s for the needle to stay in the tissue, or to be drawn out of it")]
    NotLeft(f64),
    /// The tissue was not prepared for the needle in time.
    #[error(
        "waited {0:.0} s for the tissue to be ready for the needle where it is placed; rt-core prepares that beside \
         its loops, so give it a processor, or run with --tissue chainmail"
    )]
    NoLine(f64),
    /// The tip did not arrive.
    #[error("waited {limit_s:.1} s for the tip at its target; it is {:.2} mm from it along the needle", off_along_m * 1e3)]
    NotArrived {
        /// Time limit of the move, s.
        limit_s: f64,
        /// Overshoot of the tip along the needle, m.
        off_along_m: f64,
    },
}
