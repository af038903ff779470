//! Conditions that a procedure waits for, and its patience.

use std::fmt;

/// Patience of a procedure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Patience {
    /// The usual times of an idle machine: for a rehearsal, whose time is simulated.
    #[default]
    Usual,
    /// At least this time, s: for an unattended run.
    AtLeast(f64),
    /// Unlimited, until the operator decides.
    Operator,
}

impl Patience {
    pub(super) fn limit_s(self, usual_s: f64) -> f64 {
        match self {
            Self::Usual => usual_s,
            Self::AtLeast(least_s) => usual_s.max(least_s),
            Self::Operator => f64::INFINITY,
        }
    }
}

/// A missing condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WaitsFor {
    /// The state of the force loop.
    State,
    /// The reply to a request.
    Reply(&'static str),
    /// The effect of an accepted request.
    Effect(&'static str),
    /// The dropped seed.
    Seed,
    /// A needle to stay in the tissue, or to be out of it.
    Left,
    /// The tissue, prepared for the placed needle.
    Line,
    /// The tip at its target.
    Tip {
        /// Overshoot of the tip along the needle, m.
        off_along_m: f64,
    },
    /// The tissue at rest.
    Rest,
}

impl fmt::Display for WaitsFor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::State => write!(f, "the state of the force loop"),
            Self::Reply(request) => write!(f, "a reply to {request}"),
            Self::Effect(request) => write!(f, "{request} to take effect"),
            Self::Seed => write!(f, "the seed in the tissue"),
            Self::Left => write!(f, "the needle to stay in, or to be drawn out"),
            Self::Line => write!(f, "the tissue to be ready for the needle"),
            Self::Tip { off_along_m } => write!(f, "the tip, {:.1} mm from its target", off_along_m.abs() * 1e3),
            Self::Rest => write!(f, "the tissue to rest"),
        }
    }
}

/// The condition that a procedure waits for, and the time waited.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waiting {
    /// The missing condition.
    pub waits_for: WaitsFor,
    /// Time waited, s.
    pub for_s: f64,
}
