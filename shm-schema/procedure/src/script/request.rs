//! Requests of the procedure to its driver.

use stylet_shm_schema::HandMove;

/// A request of the procedure to its driver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HandRequest {
    /// Return tissue, seeds and peaks to their start.
    Reset,
    /// Publish the plan of a needle, counted from 0.
    PublishPlan {
        /// Number of the needle.
        needle: usize,
    },
    /// Prepare the tissue for a stabilising needle, counted from 0.
    ExpectStabilising {
        /// Number of the stabilising needle.
        number: usize,
    },
    /// Leave the needle where it is.
    LeaveNeedle,
    /// Draw out the needle that was left first.
    DrawFirstLeft {
        /// Speed, m/s.
        speed_m_per_s: f64,
    },
    /// Turn the force on.
    Engage,
    /// Move the hand.
    MoveHand(HandMove),
    /// Leave a seed at the tip.
    DropSeed {
        /// Pitch between seed centres, m, if they form one strand.
        strand_pitch_m: Option<f64>,
    },
}

impl HandRequest {
    /// Name of the request in messages.
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
