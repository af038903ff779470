//! Continues a stopped procedure from the seeds in the tissue, and from the needle if it is still there.

use crate::tolerance::{OUTSIDE_M, PLACED_WITHIN_M};
use crate::{NeedleWay, Operation};
use nalgebra::Vector3;
use std::collections::{BTreeSet, VecDeque};

/// A tip deeper than a drop by less than this is drawn back to it, m; a shallower one is inserted to it.
const SAME_DEPTH_M: f64 = 1e-3;

/// Completed part of a procedure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Done {
    /// Numbers of the completed drops, counted from 0 over all needles.
    pub drops: BTreeSet<usize>,
    /// Those of them that left no seed.
    pub lost: Vec<usize>,
    /// The needle in the tissue, counted from 0, and its depth from its entry, m.
    pub inside: Option<(usize, f64)>,
}

/// Returns the needle on whose path this tip is, and its depth, m; `None` outside, and off all paths.
pub fn needle_inside(ways: &[NeedleWay], tip_m: [f64; 3]) -> Option<(usize, f64)> {
    let on = |(number, way): (usize, &NeedleWay)| {
        let from_entry_m = Vector3::from(tip_m) - way.entry_m;
        let depth_m = from_entry_m.dot(&way.direction);
        let beside_m = (from_entry_m - way.direction * depth_m).norm();
        (depth_m > OUTSIDE_M && beside_m <= PLACED_WITHIN_M).then_some((number, depth_m, beside_m))
    };
    let nearest = ways.iter().enumerate().filter_map(on);
    let nearest = nearest.min_by(|a, b| a.2.total_cmp(&b.2));
    nearest.map(|(number, depth_m, _)| (number, depth_m))
}

/// Returns the remaining operations. The needle in the tissue comes first; completed needles are omitted.
pub(super) fn ahead(ways: &[NeedleWay], done: &Done) -> VecDeque<(usize, Operation)> {
    let inside = done.inside.map(|(needle, _)| needle);
    let others = (0..ways.len()).filter(|&needle| Some(needle) != inside);
    let mut ahead = VecDeque::new();
    for needle in inside.into_iter().chain(others) {
        let way = &ways[needle];
        let first: usize = ways[..needle].iter().map(|way| way.drops_m.len()).sum();
        let is_left = |index: &usize| !done.drops.contains(&(first + index));
        let left: Vec<usize> = (0..way.drops_m.len()).filter(is_left).collect();
        let depth_m = done
            .inside
            .filter(|_| inside == Some(needle))
            .map(|(_, depth_m)| depth_m);
        if left.is_empty() && depth_m.is_none() {
            continue;
        }
        let begins = ahead.is_empty();
        let mut then = |operation| ahead.push_back((needle, operation));
        then(Operation::PublishPlan);
        if begins {
            then(Operation::Engage);
        }
        if depth_m.is_none() {
            then(Operation::Place);
        }
        for (nth, &index) in left.iter().enumerate() {
            let drop_m = (way.drops_m[index] - way.entry_m).dot(&way.direction);
            let inwards = nth == 0 && depth_m.is_none_or(|depth_m| depth_m < drop_m + SAME_DEPTH_M);
            then(match inwards {
                true => Operation::InsertTo(index),
                false => Operation::DrawBack(index),
            });
            then(Operation::Drop(first + index));
        }
        if way.retract_to_m > 0.0 && !left.is_empty() {
            then(Operation::Retract);
        }
        then(Operation::TakeOut);
        then(Operation::Settle);
    }
    ahead
}
