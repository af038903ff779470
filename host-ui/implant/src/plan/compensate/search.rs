//! The search for drops that leave seeds on plan, one seed after the other, deepest first.

use super::Limits;
use super::rehearsals::{Rehearsals, RehearsedDrops, aside, keep_within};
use crate::plan::rehearse::{Drops, RehearsalError};
use crate::plan::{Loading, Needle};

/// Resolution of the search.
const LEAST_MOVE_M: f64 = 0.05e-3;
/// Distance of the next drop from both ends, as a part of their distance.
const KEPT_FROM_ENDS: f64 = 0.1;
/// Growth of the step if a seed stays on the same side.
const LONGER: f64 = 1.5;
/// Most rehearsals for one seed.
const PER_SEED: usize = 9;
/// Step by which drops are shifted deeper if the planned ones are impossible.
pub(super) const DEEPER_M: f64 = 1e-3;

/// Searches the drops of the seeds from that number on; earlier ones stay as in `last`. Returns the
/// best rehearsal, `best` included, after a limited number.
pub(super) fn seek(
    rehearsals: &mut Rehearsals,
    from: usize,
    mut best: RehearsedDrops,
    mut last: RehearsedDrops,
    most: usize,
) -> RehearsedDrops {
    let (needle, limits) = (rehearsals.needle, rehearsals.limits);
    let sought = match needle.loading {
        Loading::Loose => best.error_m.len(),
        // A strand keeps its pitch: one step for all.
        Loading::Stranded { .. } => 1,
    };
    if from >= sought {
        return best;
    }
    let until = rehearsals.count + most;
    let mut search = Search::begin(from, needle, last.clone());
    let mut others_move = true;
    // Later drops that were refused: they are made no shallower.
    let mut least_m = vec![0.0_f64; best.error_m.len()];
    let mut next = search.next_m(needle, limits);
    while rehearsals.count < until && best.worst_m() > limits.enough_m {
        let Some(drop_m) = next else {
            if search.seed + 1 >= sought {
                break;
            }
            last = search.nearest.clone();
            search = Search::begin(search.seed + 1, needle, last.clone());
            least_m.fill(0.0);
            next = search.next_m(needle, limits);
            continue;
        };
        let mut drops = moved(needle, &search, &last, drop_m, others_move, limits);
        drops
            .along_m
            .iter_mut()
            .zip(&least_m)
            .for_each(|(along_m, least)| *along_m = along_m.max(*least));
        keep_within(needle, limits, &mut drops);
        let asked = drops.along_m.clone();
        match rehearsals.try_it(drops) {
            Ok(new) => {
                search.take(needle, &new);
                if new.mean_m() < best.mean_m() {
                    best = new.clone();
                }
                last = new;
                others_move = true;
            }
            // The refused drop may be that of another seed that was shifted along.
            Err(_) if others_move && search.seed + 1 < sought => {
                others_move = false;
                continue;
            }
            // The tissue lies deeper than the next drop: with the present one there, that one goes
            // deeper.
            Err(RehearsalError::Refused {
                drop: Some(refused), ..
            }) if (search.seed + 1..sought).contains(&refused) && asked[refused] + DEEPER_M < asked[refused - 1] => {
                least_m[refused] = asked[refused] + DEEPER_M;
                continue;
            }
            Err(_) => search.refuse(asked[search.seed]),
        }
        next = search.next_m(needle, limits);
    }
    best
}

/// Search for one seed's drop while earlier ones stay; for a strand, that of its first seed.
struct Search {
    /// Number of the seed.
    seed: usize,
    /// Deepest drop that leaves the seed short, and shallowest that leaves it too deep, with its
    /// error, unless it could not be dropped there.
    short: Option<(f64, Option<f64>)>,
    beyond: Option<(f64, Option<f64>)>,
    /// Rehearsal with the smallest error.
    nearest: RehearsedDrops,
    step_m: f64,
    tries: usize,
}

impl Search {
    fn begin(seed: usize, needle: &Needle, from: RehearsedDrops) -> Self {
        let mut search = Self {
            seed,
            short: None,
            beyond: None,
            nearest: from.clone(),
            step_m: 0.0,
            tries: 0,
        };
        search.take(needle, &from);
        search
    }

    fn take(&mut self, needle: &Needle, tried: &RehearsedDrops) {
        let (drop_m, off_m) = (tried.drops.along_m[self.seed], tried.off_m(needle, self.seed));
        if off_m.abs() < self.nearest.off_m(needle, self.seed).abs() {
            self.nearest = tried.clone();
        }
        if off_m < 0.0 && self.short.is_none_or(|(at_m, _)| drop_m > at_m) {
            self.short = Some((drop_m, Some(off_m)));
            self.beyond = self.beyond.filter(|(at_m, _)| *at_m > drop_m);
        } else if off_m >= 0.0 && self.beyond.is_none_or(|(at_m, _)| drop_m < at_m) {
            self.beyond = Some((drop_m, Some(off_m)));
            self.short = self.short.filter(|(at_m, _)| *at_m < drop_m);
        }
    }

    /// Records that the seed could not be dropped there.
    fn refuse(&mut self, drop_m: f64) {
        if drop_m > self.nearest.drops.along_m[self.seed] {
            self.beyond = Some((drop_m, None));
        } else {
            self.short = Some((drop_m, None));
        }
    }

    /// Returns the next drop to try; `None` if the error is small enough, or no improvement is
    /// likely.
    fn next_m(&mut self, needle: &Needle, limits: &Limits) -> Option<f64> {
        let is_near = self.nearest.off_m(needle, self.seed).abs() <= limits.enough_m;
        if is_near || self.tries >= PER_SEED {
            return None;
        }
        self.tries += 1;
        let planned_m = needle.seeds[self.seed].along_m;
        let deepest_m = (planned_m + limits.along_m).min(limits.reach_m);
        let shallowest_m = (planned_m - limits.along_m).max(0.0);
        match (self.short, self.beyond) {
            (Some((from_m, short)), Some((to_m, beyond))) => {
                let part = match (short, beyond) {
                    // Alternate, because a seed's place may hardly depend on its drop on one side.
                    (Some(short), Some(beyond)) if self.tries % 2 == 1 => short / (short - beyond),
                    _ => 0.5,
                };
                let part = part.clamp(KEPT_FROM_ENDS, 1.0 - KEPT_FROM_ENDS);
                (to_m - from_m > LEAST_MOVE_M).then_some(from_m + part * (to_m - from_m))
            }
            (Some((from_m, off)), None) => {
                self.step_m = off.unwrap_or(DEEPER_M).abs().max(LONGER * self.step_m);
                (from_m < deepest_m - LEAST_MOVE_M).then_some((from_m + self.step_m).min(deepest_m))
            }
            (None, Some((from_m, off))) => {
                self.step_m = off.unwrap_or(DEEPER_M).abs().max(LONGER * self.step_m);
                (from_m > shallowest_m + LEAST_MOVE_M).then_some((from_m - self.step_m).max(shallowest_m))
            }
            (None, None) => None,
        }
    }
}

/// Returns the drops of the best rehearsal with that of this seed at `drop_m`; later ones shift by
/// their last error.
fn moved(
    needle: &Needle,
    search: &Search,
    last: &RehearsedDrops,
    drop_m: f64,
    others_move: bool,
    limits: &Limits,
) -> Drops {
    let mut drops = search.nearest.drops.clone();
    let by_m = drop_m - drops.along_m[search.seed];
    let after = search.seed + 1..drops.along_m.len();
    drops.along_m[search.seed] = drop_m;
    for seed in after {
        drops.along_m[seed] = match needle.loading {
            Loading::Stranded { .. } => drops.along_m[seed] + by_m,
            Loading::Loose if others_move => last.drops.along_m[seed] - last.off_m(needle, seed),
            Loading::Loose => drops.along_m[seed],
        };
    }
    keep_within(needle, limits, &mut drops);
    aside(needle, last, limits, &mut drops);
    drops
}
