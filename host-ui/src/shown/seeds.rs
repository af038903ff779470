//! Distance of each seed at rest from its planned place, and seeds that a reset removed.

use super::Shown;
use stylet_host::link::Link;
use stylet_implant::pairing::{self, SeedOffset};
use stylet_shm_schema::{Event, EventKind, PlannedSeed, SeedPose};

impl Shown {
    /// Notes how many seeds a reset has just removed: the core restores them until another is dropped.
    pub(super) fn take_removed(&mut self, before: usize, link: &Link) {
        let kinds = link.events().iter().rev().map(|e| EventKind::from_number(e.kind));
        let is_of_seeds = |kind: &Option<EventKind>| {
            matches!(
                kind,
                Some(EventKind::Reset | EventKind::SeedDropped | EventKind::SceneLoaded)
            )
        };
        let was_reset = kinds.into_iter().find(is_of_seeds) == Some(Some(EventKind::Reset));
        if !was_reset || !self.seeds.is_empty() {
            self.removed = 0;
        } else if before > 0 {
            self.removed = before;
        }
    }

    /// Notes when the core last stopped the needle before its goal.
    pub(super) fn take_given_up(&mut self, link: &Link) {
        const NEEDLES_HAND: u32 = 0;
        let is_given_up = |e: &&Event| e.kind == EventKind::MotionGivenUp as u32 && e.code == NEEDLES_HAND;
        self.given_up_at = link.events().iter().rev().find(is_given_up).map(|e| e.tick);
    }
}

/// Error of a placed seed relative to the planned one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeedError {
    /// Index in the plan.
    pub planned: usize,
    /// Index in the order of dropping; `None` while it is missing.
    pub placed: Option<usize>,
    /// Distance along the needle, positive in the direction of insertion.
    pub along_m: f64,
    pub across_m: f64,
}

impl SeedError {
    fn new(planned: usize, placed: Option<usize>, offset: Option<SeedOffset>) -> Self {
        Self {
            planned,
            placed,
            along_m: offset.map_or(0.0, |o| o.along_m),
            across_m: offset.map_or(0.0, |o| o.across_m),
        }
    }
}

/// Returns one row for each planned seed, paired with the nearest drop.
pub fn seed_errors(planned: &[PlannedSeed], placed: &[SeedPose], direction: [f64; 3]) -> Vec<SeedError> {
    let planned_m: Vec<_> = planned.iter().map(|p| p.position_m).collect();
    let dropped_at_m: Vec<_> = placed.iter().map(|p| p.dropped_at_m).collect();
    rows(planned, placed, direction, pairing::nearest(&planned_m, &dropped_at_m))
}

/// Returns the errors of the inserted needle. Seeds of a plan of many needles are dropped in its
/// order, which identifies them even if compensation drops one at the place of another.
pub fn own_errors(shown: &Shown) -> Vec<SeedError> {
    let Some(plan) = &shown.plan else { return Vec::new() };
    if shown.planning.at_work().is_none() && plan.prescribed.needle > 0 {
        let of_needle = shown.heard.last().map(|seed| seed.needle);
        return heard_rows(shown)
            .filter(|(n, _)| Some(*n) == of_needle)
            .map(|(_, row)| row)
            .collect();
    }
    if shown.planning.at_work().is_none() {
        return seed_errors(shown.planned(), &shown.seeds, plan.direction);
    }
    in_order(shown.planned(), shown.own_seeds(), plan.direction)
}

/// Returns the errors of all needles that have begun, each with the number of its needle.
pub fn all_errors(shown: &Shown) -> Vec<(usize, SeedError)> {
    let Some(implant) = &shown.planning.implant else {
        if shown.plan.is_some_and(|plan| plan.prescribed.needle > 0) {
            return heard_rows(shown).collect();
        }
        return own_errors(shown).into_iter().map(|row| (0, row)).collect();
    };
    let progress = &shown.planning.progress;
    let of_needle = |number: usize| {
        let needle = &implant.plan.needles[number];
        let planned: Vec<PlannedSeed> = needle.seeds_m().map(|position_m| PlannedSeed { position_m }).collect();
        let placed = &shown.seeds[progress.seeds_of(number, shown.seeds.len())];
        let rows = in_order(&planned, placed, needle.direction);
        rows.into_iter().map(move |row| (number, row)).collect::<Vec<_>>()
    };
    (0..progress.begun().min(implant.plan.needles.len()))
        .flat_map(of_needle)
        .collect()
}

/// Returns the errors of a plan that another window inserts, each with the number of its needle.
fn heard_rows(shown: &Shown) -> impl Iterator<Item = (usize, SeedError)> {
    let mut before = (0, 0);
    shown.heard.iter().map(move |seed| {
        // Seeds are counted from 0 in each needle.
        before = if before.0 == seed.needle {
            (seed.needle, before.1 + 1)
        } else {
            (seed.needle, 1)
        };
        let pose = seed.placed.and_then(|place| shown.seeds.get(place));
        let direction = seed.planned.axis.unwrap_or_default();
        let offset = pose.map(|pose| SeedOffset::of(seed.planned.position_m, pose.position_m, direction));
        (seed.needle, SeedError::new(before.1 - 1, seed.placed, offset))
    })
}

/// Returns seeds in the order of the drops; planned seeds that are still missing come last.
fn in_order(planned: &[PlannedSeed], placed: &[SeedPose], direction: [f64; 3]) -> Vec<SeedError> {
    let pairs = pairing::in_order(planned.len(), &[], placed.len());
    rows(planned, placed, direction, pairs)
}

fn rows(
    planned: &[PlannedSeed],
    placed: &[SeedPose],
    direction: [f64; 3],
    pairs: Vec<Option<usize>>,
) -> Vec<SeedError> {
    let row = |(number, (target, pair)): (usize, (&PlannedSeed, Option<usize>))| {
        let seed = pair.and_then(|n| placed.get(n));
        let offset = seed.map(|seed| SeedOffset::of(target.position_m, seed.position_m, direction));
        SeedError::new(number, pair, offset)
    };
    planned.iter().zip(pairs).enumerate().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_dropped_in_reverse_find_their_plan_and_drift_is_split() {
        let planned = [0.01, 0.02].map(|z| PlannedSeed {
            position_m: [0.0, 0.0, z],
        });
        let placed = [0.02, 0.01].map(|z| SeedPose {
            position_m: [0.003, 0.0, z + 0.001],
            axis: [0.0, 0.0, 1.0],
            dropped_at_m: [0.0, 0.0, z],
        });
        let rows = seed_errors(&planned, &placed, [0.0, 0.0, 1.0]);
        assert_eq!(rows[0].placed, Some(1));
        assert_eq!(rows[1].placed, Some(0));
        assert!((rows[0].along_m - 0.001).abs() < 1e-12 && (rows[0].across_m - 0.003).abs() < 1e-12);
        assert_eq!(seed_errors(&planned, &placed[..1], [0.0, 0.0, 1.0])[0].placed, None);
    }
}
