//! The operations of one needle, in order, and the tip's target in each.

use nalgebra::Vector3;

/// Speeds and acceleration of the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Speed from the entry to the first drop, m/s.
    pub insert_m_per_s: f64,
    /// Speed between drops and out, m/s.
    pub retract_m_per_s: f64,
    /// Speed to the entry, m/s.
    pub approach_m_per_s: f64,
    /// Acceleration of the hand, m/s².
    pub acceleration_m_per_s2: f64,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            insert_m_per_s: 0.05,
            retract_m_per_s: 0.05,
            approach_m_per_s: 0.1,
            acceleration_m_per_s2: 2.0,
        }
    }
}

/// Path of the tip for one needle, scene frame.
#[derive(Clone, Debug, PartialEq)]
pub struct NeedleWay {
    /// Start of the tip, outside the body, m.
    pub entry_m: Vector3<f64>,
    /// Unit vector into the body.
    pub direction: Vector3<f64>,
    /// Drop positions, m, in the order of the drops: deepest first.
    pub drops_m: Vec<Vector3<f64>>,
    /// Depth to which the tip is drawn back after the last drop, m, from the entry along the needle.
    pub retract_to_m: f64,
    /// Pitch between seed centres, m, if they form one strand.
    pub strand_pitch_m: Option<f64>,
}

/// A step of the procedure, as shown to users.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// Plan the needle and its seeds.
    Plan,
    /// Bring the tip to the entry.
    Place,
    /// Push the tip to the deepest drop.
    Insert,
    /// Drop the seeds, one at each position on the way out.
    Drop,
    /// Take the needle out.
    Retract,
    /// Wait until the tissue is at rest.
    Settle,
    /// The needle is done.
    Done,
}

impl Step {
    /// The step as an instruction.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plan => "plan the needle and the seeds",
            Self::Place => "place the needle",
            Self::Insert => "insert",
            Self::Drop => "drop the seeds",
            Self::Retract => "retract",
            Self::Settle => "wait for the tissue to rest",
            Self::Done => "done",
        }
    }
}

/// One action; each has its own criterion for its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// Return tissue, seeds and peaks to their start.
    Reset,
    /// Publish the plan of the needle.
    PublishPlan,
    /// Turn the force on.
    Engage,
    /// Move the tip to the entry.
    Place,
    /// Move the tip to the first drop.
    Insert,
    /// Move the tip inwards to a drop, counted from 0 in its needle, when continuing a needle.
    InsertTo(usize),
    /// Drop a seed, counted from 0 over all needles.
    Drop(usize),
    /// Draw the tip back to a drop, counted from 0 in its needle.
    DrawBack(usize),
    /// Draw the tip back to its resting place after the last drop.
    Retract,
    /// Draw the tip back to the entry.
    TakeOut,
    /// Leave the needle where it is; the hand comes out without it.
    Leave,
    /// Draw out the needle that was left first.
    DrawOut,
    /// Wait until the tissue is at rest.
    Settle,
}

impl Operation {
    /// Returns the step that contains the operation.
    pub fn step(self) -> Step {
        match self {
            Self::Reset | Self::PublishPlan => Step::Plan,
            Self::Engage | Self::Place => Step::Place,
            Self::Insert | Self::InsertTo(_) | Self::Leave => Step::Insert,
            Self::Drop(_) | Self::DrawBack(_) => Step::Drop,
            Self::Retract | Self::TakeOut | Self::DrawOut => Step::Retract,
            Self::Settle => Step::Settle,
        }
    }

    /// Returns the tip's target, m, and its speed, m/s; `None` if the tip does not move.
    pub(crate) fn target(self, way: &NeedleWay, pace: &Pace) -> Option<(Vector3<f64>, f64)> {
        match self {
            Self::Place => Some((way.entry_m, pace.approach_m_per_s)),
            Self::Insert => way.drops_m.first().map(|&drop_m| (drop_m, pace.insert_m_per_s)),
            Self::InsertTo(index) => way.drops_m.get(index).map(|&drop_m| (drop_m, pace.insert_m_per_s)),
            Self::DrawBack(index) => way.drops_m.get(index).map(|&drop_m| (drop_m, pace.retract_m_per_s)),
            Self::Retract => Some((way.entry_m + way.direction * way.retract_to_m, pace.retract_m_per_s)),
            Self::TakeOut => Some((way.entry_m, pace.retract_m_per_s)),
            Self::Reset
            | Self::PublishPlan
            | Self::Engage
            | Self::Drop(_)
            | Self::Leave
            | Self::DrawOut
            | Self::Settle => None,
        }
    }
}

impl NeedleWay {
    /// Returns the operations from the entry to the last drop; the number of the first drop is `first_drop`.
    pub(crate) fn to_the_last_drop(&self, first_drop: usize) -> impl Iterator<Item = Operation> {
        let of_drop = move |index: usize| {
            let arrive = match index {
                0 => Operation::Insert,
                _ => Operation::DrawBack(index),
            };
            [arrive, Operation::Drop(first_drop + index)]
        };
        std::iter::once(Operation::Place).chain((0..self.drops_m.len()).flat_map(of_drop))
    }
}
