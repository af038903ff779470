//! What a procedure waits for, and how long it does.

use std::fmt;

/// How long a procedure waits for what does not arrive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Patience {
    /// For the usual times, in which an idle machine answers: for a rehearsal, whose time is its own.
    #[default]
    Usual,
    /// For this time at least, s: for a run that nobody watches.
    AtLeast(f64),
    /// Until the operator decides.
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

/// What is not there yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WaitsFor {
    /// The state of the force loop.
    State,
    /// The reply to a request.
    Reply(&'static str),
    /// A request that was accepted to take effect.
    Effect(&'static str),
    /// The seed that was dropped.
    Seed,
    /// A needle to stay in the tissue, or to be out of it.
    Left,
    /// The tissue, prepared for the needle where it is placed.
    Line,
    /// The tip at its target.
    Tip {
        /// How far it is beyond its target along the needle, m.
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

/// What a procedure waits for, and for how long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waiting {
    /// What is not there yet.
    pub waits_for: WaitsFor,
    /// For so long, s.
    pub for_s: f64,
}
