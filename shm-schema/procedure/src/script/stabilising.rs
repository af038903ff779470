//! Needles that go in first and stay while the others come and go.

use super::Procedure;
use crate::tolerance::TISSUE_REST_M;
use crate::{NeedleWay, Operation, Pace};
use std::collections::VecDeque;

impl Procedure {
    /// Adds needles that go in first, stay in without a seed while the others come and go, and are drawn out at the
    /// end.
    #[must_use]
    pub fn stabilised(self, stabilising: Vec<NeedleWay>) -> Self {
        if stabilising.is_empty() {
            return self;
        }
        let mut own = self.ahead;
        let mut ahead = VecDeque::new();
        let first = self.ways.len();
        // A reset at the start of the first needle moves before the stabilising ones.
        if own.front() == Some(&(0, Operation::Reset)) {
            ahead.extend(own.pop_front());
        }
        own.retain(|(_, operation)| *operation != Operation::Engage);
        ahead.extend(stay(first, stabilising.len()));
        ahead.append(&mut own);
        for number in 0..stabilising.len() {
            ahead.push_back((first + number, Operation::DrawOut));
        }
        ahead.push_back((first + stabilising.len() - 1, Operation::Settle));
        Self {
            stabilising,
            ahead,
            ..self
        }
    }

    /// Returns the script of one needle in tissue at rest, until the tissue rests again with the needle drawn back;
    /// with needles that go in first and stay.
    pub fn rehearsal(way: NeedleWay, pace: Pace, stabilising: Vec<NeedleWay>) -> Self {
        let mut ahead: VecDeque<_> = stay(1, stabilising.len()).collect();
        ahead.push_back((
            0,
            if ahead.is_empty() {
                Operation::Engage
            } else {
                Operation::PublishPlan
            },
        ));
        ahead.extend(way.to_the_last_drop(0).map(|operation| (0, operation)));
        ahead.extend([(0, Operation::Retract), (0, Operation::Settle)]);
        Self {
            stabilising,
            ..Self::new(vec![way], pace, ahead)
        }
    }

    /// Returns the script of one needle that goes to its first drop and out again without dropping a seed, in tissue
    /// that then comes to rest.
    pub fn pass(way: NeedleWay, pace: Pace) -> Self {
        let then = [
            Operation::Engage,
            Operation::Place,
            Operation::Insert,
            Operation::TakeOut,
            Operation::Settle,
        ];
        Self::new(vec![way], pace, then.map(|operation| (0, operation)).into())
    }

    /// Returns the present stabilising needle, counted from 0; `None` while a needle that drops seeds is at work.
    pub fn stabilising(&self) -> Option<usize> {
        let (needle, _) = self.ahead.front()?;
        needle.checked_sub(self.ways.len())
    }

    /// True if the tissue has not moved: with needles in it, it rests away from zero.
    pub(super) fn keeps(&mut self, displacement_m: f64) -> bool {
        let keeps = (displacement_m - self.kept_m).abs() < TISSUE_REST_M;
        if !keeps {
            self.kept_m = displacement_m;
        }
        keeps
    }
}

/// Returns the operations of needles that go in and stay, numbered from `first`.
fn stay(first: usize, count: usize) -> impl Iterator<Item = (usize, Operation)> {
    (first..first + count).flat_map(move |needle| {
        let begins = (needle == first).then_some(Operation::Engage);
        let before = std::iter::once(Operation::PublishPlan).chain(begins);
        let then = [
            Operation::Place,
            Operation::Insert,
            Operation::Leave,
            Operation::TakeOut,
        ];
        before.chain(then).map(move |operation| (needle, operation))
    })
}
