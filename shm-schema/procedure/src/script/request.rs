//! What the procedure asks of whoever drives it.

use stylet_shm_schema::HandMove;

/// What the procedure asks of whoever drives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HandRequest {
    /// Bring tissue, seeds and peaks back to their start.
    Reset,
    /// Publish the plan of a needle, counted from 0.
    PublishPlan {
        /// Which needle.
        needle: usize,
    },
    /// Have the tissue prepared for a stabilising needle, counted from 0.
    ExpectStabilising {
        /// Which one.
        number: usize,
    },
    /// Leave the needle where it is.
    LeaveNeedle,
    /// Draw out the needle that was left first of those that stay in.
    DrawFirstLeft {
        /// How fast, m/s.
        speed_m_per_s: f64,
    },
    /// Turn the force on.
    Engage,
    /// Move the hand.
    MoveHand(HandMove),
    /// Leave a seed at the tip.
    DropSeed {
        /// From middle to middle of two seeds, m, where they are one strand.
        strand_pitch_m: Option<f64>,
    },
}

impl HandRequest {
    /// The request in a message to people.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Reset => "Reset",
            Self::PublishPlan { .. } => "SetPlan",
            Self::ExpectStabilising { .. } => "ExpectNeedle",
            Self::LeaveNeedle => "LeaveNeedle",
            Self::DrawFirstLeft { .. } => "DrawNeedle",
            Self::Engage => "Engage",
            Self::MoveHand(_) => "MoveHand",
            Self::DropSeed { .. } => "DropSeed",
        }
    }
}
