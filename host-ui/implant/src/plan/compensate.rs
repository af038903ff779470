//! Where to drop each seed so that it rests on plan: rehearse, see where the seeds end, drop them elsewhere, rehearse again.
//!
//! What a seed does depends on its own drop and on those before it, not on those that come after. So the deepest seed's drop is
//! sought first, and with that fixed the next one's. The deeper a seed is dropped the deeper it rests, but not in
//! proportion: tissue that sticks to the needle goes along for millimetres, so that many drops leave a seed in one place,
//! and where it lets go a seed's place jumps. A drop is therefore sought between one that leaves the seed short and one that leaves it too far in.
//! Seeds that are not sought yet move along by what they are off, which often is enough.

use super::rehearse::{Drops, RehearsalError, Rehearser, Rest};
use super::{Loading, Needle};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_procedure::Pace;

/// What compensation may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// A drop is never further from its planned place along the needle.
    pub along_m: f64,
    /// Nor the needle across; 0 keeps it in its hole.
    pub across_m: f64,
    /// Deepest that the tip may go, from the entry.
    pub reach_m: f64,
    /// Rehearsals of one needle at most, the first one included.
    pub rehearsals: usize,
    /// Good enough: no seed is farther from plan.
    pub enough_m: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            along_m: 15e-3,
            across_m: 1.5e-3,
            reach_m: super::check::REACH_M,
            rehearsals: 30,
            enough_m: 0.1e-3,
        }
    }
}

/// A drop is not sought any closer.
const LEAST_MOVE_M: f64 = 0.05e-3;
/// Between two drops the next one keeps from both by this part of their distance.
const KEPT_FROM_ENDS: f64 = 0.1;
/// Where a step leaves a seed on the same side, the next one is so many times as long.
const LONGER: f64 = 1.5;
/// Rehearsals for one seed, at most.
const PER_SEED: usize = 9;
/// Drops of one needle keep their order by at least this.
const APART_M: f64 = 0.1e-3;

/// Where dropping as planned is not possible, drops are tried so much deeper at a time.
const DEEPER_M: f64 = 1e-3;

/// One needle, before and after.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compensation {
    /// The drops that leave the smallest errors.
    pub drops: Drops,
    /// Rest minus plan of each seed, deepest first, when dropped as planned; `None` where that cannot be done: the tip would be
    /// outside the tissue, which has moved ahead.
    pub before_m: Option<Vec<[f64; 3]>>,
    /// The same when dropped as `drops` says.
    pub after_m: Vec<[f64; 3]>,
    /// Rehearsals that it took.
    pub rehearsals: usize,
}

impl Compensation {
    /// Distance of each seed from plan when dropped as planned, m.
    pub fn errors_before_m(&self) -> impl Iterator<Item = f64> + '_ {
        self.before_m.iter().flatten().map(|e| Vector3::from(*e).norm())
    }

    /// Distance of each seed from plan with the compensated drops, m.
    pub fn errors_after_m(&self) -> impl Iterator<Item = f64> + '_ {
        self.after_m.iter().map(|e| Vector3::from(*e).norm())
    }
}

/// Drops that were rehearsed, and the errors of their seeds.
#[derive(Clone)]
struct Tried {
    drops: Drops,
    error_m: Vec<Vector3<f64>>,
}

impl Tried {
    fn mean_m(&self) -> f64 {
        self.error_m.iter().map(Vector3::norm).sum::<f64>() / self.error_m.len().max(1) as f64
    }

    fn worst_m(&self) -> f64 {
        self.error_m.iter().map(Vector3::norm).fold(0.0, f64::max)
    }

    /// How far a seed lies beyond its place along the needle; of a strand, all of it.
    fn off_m(&self, needle: &Needle, seed: usize) -> f64 {
        let direction = Vector3::from(needle.direction);
        let along = |e: &Vector3<f64>| e.dot(&direction);
        match needle.loading {
            Loading::Loose => self.error_m.get(seed).map_or(0.0, along),
            Loading::Stranded { .. } => median(self.error_m.iter().map(along).collect()),
        }
    }
}

/// Where one seed's drop is sought, while those before it stay; of a strand, that of its first seed.
struct Search {
    /// Number of the seed.
    seed: usize,
    /// The deepest drop that leaves it short of its place, and the shallowest that leaves it beyond; how far, unless it could not be
    /// dropped there.
    short: Option<(f64, Option<f64>)>,
    beyond: Option<(f64, Option<f64>)>,
    /// The rehearsal that brought it nearest.
    nearest: Tried,
    step_m: f64,
    tries: usize,
}

impl Search {
    fn begin(seed: usize, needle: &Needle, from: Tried) -> Self {
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

    fn take(&mut self, needle: &Needle, tried: &Tried) {
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

    /// It could not be dropped there.
    fn refuse(&mut self, drop_m: f64) {
        if drop_m > self.nearest.drops.along_m[self.seed] {
            self.beyond = Some((drop_m, None));
        } else {
            self.short = Some((drop_m, None));
        }
    }

    /// The next drop to try; `None` where it is near enough, or nothing better is to be expected.
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
                    // By turns, as the rest of a seed may hardly depend on its drop on one side.
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

/// The best way found; dropping as planned where nothing is better. An error when no way was found to go through with the needle.
pub fn compensate(
    needle: &Needle,
    pace: &Pace,
    limits: &Limits,
    rehearser: &mut dyn Rehearser,
) -> Result<Compensation, RehearsalError> {
    let (start, is_as_planned) = start(needle, pace, limits, rehearser)?;
    let (mut best, mut last) = (start.clone(), start.clone());
    let mut rehearsals = 1;
    let mut drops = start.drops.clone();
    aside(needle, &start, limits, &mut drops);
    if drops != start.drops {
        rehearsals += 1;
        if let Ok(new) = try_it(needle, drops, pace, rehearser) {
            if new.mean_m() < best.mean_m() {
                best = new.clone();
            }
            last = new;
        }
    }
    let mut search = Search::begin(0, needle, last.clone());
    let mut others_move = true;
    let sought = match needle.loading {
        Loading::Loose => start.error_m.len(),
        // A strand keeps its pitch: one step for all.
        Loading::Stranded { .. } => 1,
    };
    let mut next = search.next_m(needle, limits);
    while rehearsals < limits.rehearsals && best.worst_m() > limits.enough_m {
        let Some(drop_m) = next else {
            if search.seed + 1 >= sought {
                break;
            }
            last = search.nearest.clone();
            search = Search::begin(search.seed + 1, needle, last.clone());
            next = search.next_m(needle, limits);
            continue;
        };
        let drops = moved(needle, &search, &last, drop_m, others_move, limits);
        let asked_m = drops.along_m[search.seed];
        rehearsals += 1;
        match try_it(needle, drops, pace, rehearser) {
            Ok(new) => {
                search.take(needle, &new);
                if new.mean_m() < best.mean_m() {
                    best = new.clone();
                }
                last = new;
                others_move = true;
            }
            // It may be another seed that cannot be dropped where it was moved along to.
            Err(_) if others_move && search.seed + 1 < sought => {
                others_move = false;
                continue;
            }
            Err(_) => search.refuse(asked_m),
        }
        next = search.next_m(needle, limits);
    }
    let vectors = |t: &Tried| t.error_m.iter().map(|e| (*e).into()).collect();
    Ok(Compensation {
        before_m: is_as_planned.then(|| vectors(&start)),
        after_m: vectors(&best),
        drops: best.drops,
        rehearsals,
    })
}

/// As planned, and whether that could be done; else with drops deeper by the first millimetres that can.
fn start(
    needle: &Needle,
    pace: &Pace,
    limits: &Limits,
    rehearser: &mut dyn Rehearser,
) -> Result<(Tried, bool), RehearsalError> {
    let planned = Drops::as_planned(needle);
    let why = match try_it(needle, planned.clone(), pace, rehearser) {
        Ok(tried) => return Ok((tried, true)),
        Err(why) => why,
    };
    let last = planned.along_m.len().saturating_sub(1).max(1) as f64;
    // All by as much; or, where seeds are loose, the last one most: the first may be near the far end of the tissue.
    let ways: &[fn(usize, f64) -> f64] = match needle.loading {
        Loading::Loose => &[|_, _| 1.0, |i, last| i as f64 / last],
        Loading::Stranded { .. } => &[|_, _| 1.0],
    };
    let steps = (limits.along_m / DEEPER_M) as usize;
    for (step, share) in (1..=steps).flat_map(|step| ways.iter().map(move |share| (step, share))) {
        let mut drops = planned.clone();
        for (i, along_m) in drops.along_m.iter_mut().enumerate() {
            *along_m = (*along_m + step as f64 * DEEPER_M * share(i, last)).min(limits.reach_m);
        }
        if let Ok(tried) = try_it(needle, drops, pace, rehearser) {
            return Ok((tried, false));
        }
    }
    Err(why)
}

fn try_it(needle: &Needle, drops: Drops, pace: &Pace, rehearser: &mut dyn Rehearser) -> Result<Tried, RehearsalError> {
    let Rest { seeds_m, .. } = rehearser.rehearse(&drops, pace)?;
    let off = |(rest, planned): (&[f64; 3], [f64; 3])| Vector3::from(*rest) - Vector3::from(planned);
    Ok(Tried {
        error_m: seeds_m.iter().zip(needle.seeds_m()).map(off).collect(),
        drops,
    })
}

/// The drops of the nearest rehearsal with that of the sought seed at `drop_m`; those after it by what they were off last.
fn moved(needle: &Needle, search: &Search, last: &Tried, drop_m: f64, others_move: bool, limits: &Limits) -> Drops {
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

/// What a strand is off: moved by that, its seeds are off by the least in the mean.
fn median(mut off_m: Vec<f64>) -> f64 {
    off_m.sort_by(f64::total_cmp);
    let n = off_m.len();
    match n {
        0 => 0.0,
        _ => 0.5 * (off_m[(n - 1) / 2] + off_m[n / 2]),
    }
}

/// Drops near enough to the plan, none deeper than the tip may go, deepest first: a drop must not need the tip to go in again.
fn keep_within(needle: &Needle, limits: &Limits, drops: &mut Drops) {
    for (along_m, planned) in drops.along_m.iter_mut().zip(&needle.seeds) {
        let [least, most] = [planned.along_m - limits.along_m, planned.along_m + limits.along_m];
        *along_m = along_m.clamp(least.max(0.0), most.min(limits.reach_m).max(least.max(0.0)));
    }
    for i in 1..drops.along_m.len() {
        drops.along_m[i] = drops.along_m[i].min(drops.along_m[i - 1] - APART_M);
    }
}

/// The needle as a whole moves across by what its seeds are off on average; for next to nothing it stays in its place, where the
/// tissue is ready for it.
fn aside(needle: &Needle, last: &Tried, limits: &Limits, drops: &mut Drops) {
    let direction = Vector3::from(needle.direction);
    let sum = last.error_m.iter().fold(Vector3::zeros(), |sum, e| sum + e);
    let mean = sum / last.error_m.len().max(1) as f64;
    let across = mean - direction * mean.dot(&direction);
    if across.norm() < 0.5 * limits.enough_m {
        drops.entry_m = last.drops.entry_m;
        return;
    }
    let shifted = Vector3::from(last.drops.entry_m) - across - Vector3::from(needle.entry_m);
    let size = shifted.norm();
    let kept = if size > limits.across_m {
        shifted * (limits.across_m / size)
    } else {
        shifted
    };
    drops.entry_m = (Vector3::from(needle.entry_m) + kept).into();
}

/// Means and the worst: before, of the needles that can be done as planned; after, of all.
pub fn summary_m<'a>(all: impl IntoIterator<Item = &'a Compensation> + Clone) -> [[f64; 2]; 2] {
    let figures = |errors: Vec<f64>| {
        let mean = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        [mean, errors.iter().copied().fold(0.0, f64::max)]
    };
    [
        figures(
            all.clone()
                .into_iter()
                .flat_map(Compensation::errors_before_m)
                .collect(),
        ),
        figures(all.into_iter().flat_map(Compensation::errors_after_m).collect()),
    ]
}

#[cfg(test)]
mod tests;
