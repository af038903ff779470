//! The procedure for a hand without a script: its step and the next operation, from observation alone.

use crate::tolerance::{BY_HAND_M, OUTSIDE_M, PLACED_BEFORE_M, PLACED_WITHIN_M, STALLED_M, is_at_rest};
use crate::{Operation, Step};

/// A needle and its path at present. Depths are from the entry along the path, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtHand {
    /// Depth of the tip, m.
    pub depth_m: f64,
    /// Distance of the tip from the path, m.
    pub beside_m: f64,
    /// True if the tip is in the body without contact, as after a reset: it meets no tissue until it has been outside.
    pub is_free_inside: bool,
    /// Speed of the tip along the needle, m/s; `None` while unknown.
    pub speed_m_per_s: Option<f64>,
    /// Seeds that this needle has dropped.
    pub dropped: usize,
    /// Depth of the deepest drop, m.
    pub deepest_drop_m: Option<f64>,
    /// Depth of the next drop, m; `None` when all seeds are dropped.
    pub next_drop_m: Option<f64>,
}

impl AtHand {
    /// Returns the present step: [`Step::Place`] to [`Step::Retract`], or [`Step::Done`] once it is outside again.
    pub fn step(&self) -> Step {
        if self.next_drop_m.is_none() {
            return if self.is_outside() { Step::Done } else { Step::Retract };
        }
        if self.is_free_inside {
            return Step::Place;
        }
        let is_deep = self
            .deepest_drop_m
            .is_some_and(|deepest_m| self.depth_m >= deepest_m - STALLED_M);
        if self.dropped > 0 || is_deep {
            Step::Drop
        } else if !self.is_on_path() || self.depth_m < -PLACED_BEFORE_M {
            Step::Place
        } else {
            Step::Insert
        }
    }

    /// Returns the next operation; `None` when the needle is done.
    pub fn next(&self) -> Option<Operation> {
        match self.step() {
            Step::Place => Some(Operation::Place),
            Step::Insert => Some(Operation::Insert),
            Step::Drop if self.is_at_next_drop() => Some(Operation::Drop(self.dropped)),
            Step::Drop => Some(Operation::DrawBack(self.dropped)),
            Step::Retract => Some(Operation::TakeOut),
            Step::Plan | Step::Settle | Step::Done => None,
        }
    }

    /// True if the needle is near enough to the path to go in.
    pub fn is_on_path(&self) -> bool {
        self.beside_m <= PLACED_WITHIN_M
    }

    /// True if the tip is outside the body, or too near the entry to matter.
    pub fn is_outside(&self) -> bool {
        self.depth_m < OUTSIDE_M
    }

    /// True if the seed may be dropped: the tip is at its place, or rests as near to it as the force lets the hand
    /// come.
    pub fn is_at_next_drop(&self) -> bool {
        let Some(next_m) = self.next_drop_m else { return false };
        let off_m = (self.depth_m - next_m).abs();
        off_m <= BY_HAND_M || (off_m <= STALLED_M && self.speed_m_per_s.is_some_and(is_at_rest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NeedleWay;
    use nalgebra::Vector3;

    /// A tip at its goal, along z from the origin, with drops at 30 and 20 mm.
    fn at(depth_m: f64, dropped: usize) -> AtHand {
        let drops_m = [0.03, 0.02];
        AtHand {
            depth_m,
            beside_m: 0.0,
            is_free_inside: false,
            speed_m_per_s: Some(0.0),
            dropped,
            deepest_drop_m: Some(drops_m[0]),
            next_drop_m: drops_m.get(dropped).copied(),
        }
    }

    #[test]
    fn a_hand_that_does_what_comes_next_does_the_operations_of_the_script() {
        let way = NeedleWay {
            entry_m: Vector3::zeros(),
            direction: Vector3::z(),
            drops_m: [0.03, 0.02].map(|z| Vector3::new(0.0, 0.0, z)).to_vec(),
            retract_to_m: 0.0,
            strand_pitch_m: None,
        };
        let mut scripted: Vec<Operation> = way.to_the_last_drop(0).collect();
        scripted.push(Operation::TakeOut);
        let (mut depth_m, mut dropped) = (-0.05, 0);
        let mut done = Vec::new();
        while let Some(operation) = at(depth_m, dropped).next() {
            match operation.target(&way, &crate::Pace::default()) {
                Some((to_m, _)) => depth_m = to_m.z,
                None => dropped += 1,
            }
            done.push(operation);
        }
        assert_eq!(done, scripted);
    }

    #[test]
    fn a_needle_beside_its_path_or_far_before_the_entry_is_to_be_placed() {
        let beside = AtHand {
            beside_m: 2e-3,
            ..at(0.0, 0)
        };
        assert_eq!(beside.step(), Step::Place);
        assert_eq!(at(-6e-3, 0).step(), Step::Place);
        assert_eq!(at(-4e-3, 0).step(), Step::Insert);
        for depth_m in [0.01, 0.03] {
            let untouched = AtHand {
                is_free_inside: true,
                ..at(depth_m, 0)
            };
            assert_eq!(
                untouched.next(),
                Some(Operation::Place),
                "{depth_m} m deep after a reset"
            );
        }
    }

    #[test]
    fn a_hand_that_is_held_back_may_drop_once_it_rests() {
        assert!(at(0.0295, 0).is_at_next_drop());
        assert!(at(0.0285, 0).is_at_next_drop());
        let moving = AtHand {
            speed_m_per_s: Some(6e-3),
            ..at(0.0285, 0)
        };
        assert!(!moving.is_at_next_drop());
        assert!(!at(0.0275, 0).is_at_next_drop());
    }
}
