//! Where to drop each seed so that it rests on plan: rehearse, see where the seeds end, drop them so much further the other way,
//! rehearse again.
//!
//! The tissue lies ahead of its place at rest when a seed leaves the needle, by some millimetres that hardly change with the
//! place of the drop. So each step moves a drop by the error that is left, over the slope of rest against drop that the last two
//! rehearsals show (a secant; at first 1). Rest against drop has jumps, where the tip takes hold of another element: once a seed
//! has been seen to rest on both sides of its place, its drop is sought between those two. Where a step makes the needle worse,
//! the best drops of the single seeds are tried together. What half of the rehearsals do not bring home is looked for around
//! each seed's best drop.

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
            rehearsals: 16,
            enough_m: 0.1e-3,
        }
    }
}

/// The slope of rest against drop is taken to lie between these.
const SLOPES: [f64; 2] = [0.5, 2.0];
/// Two drops less far apart say nothing about the slope.
const LEAST_MOVE_M: f64 = 0.05e-3;
/// A seed's drop is sought between two of its last drops, so many of them: older ones were with other drops of its neighbours.
const REMEMBERED: usize = 5;
/// Between two drops the next one keeps from both by this part of their distance.
const KEPT_FROM_ENDS: f64 = 0.1;
/// Drops of one needle keep their order by at least this.
const APART_M: f64 = 0.1e-3;

/// In the second half of the rehearsals each seed is tried so far from its best drop, in turn.
const AROUND_M: [f64; 6] = [0.3e-3, -0.3e-3, 0.6e-3, -0.6e-3, 0.15e-3, -0.15e-3];
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
}

/// For each seed, the drop that brought it nearest to plan. Where a seed rests depends on its own drop most of all, so these
/// together may do where steps of all seeds at once do not.
struct Nearest(Vec<(f64, f64)>);

impl Nearest {
    fn of(tried: &Tried) -> Self {
        let drops = tried.drops.along_m.iter().zip(&tried.error_m);
        Self(drops.map(|(&along_m, error_m)| (along_m, error_m.norm())).collect())
    }

    fn take(&mut self, tried: &Tried) {
        for (kept, new) in self.0.iter_mut().zip(Self::of(tried).0) {
            if new.1 < kept.1 {
                *kept = new;
            }
        }
    }

    /// Each loose seed that is not near enough yet, so far from its best drop; nothing for a strand.
    fn around(&self, needle: &Needle, best: &Tried, turn: usize, limits: &Limits) -> Option<Drops> {
        let by_m = AROUND_M[turn % AROUND_M.len()];
        let moved = |&(along_m, off_m): &(f64, f64)| along_m + if off_m > limits.enough_m { by_m } else { 0.0 };
        let mut drops = best.drops.clone();
        drops.along_m = self.0.iter().map(moved).collect();
        keep_within(needle, limits, &mut drops);
        (needle.loading == Loading::Loose).then_some(drops)
    }

    /// Nothing for a strand, which keeps its pitch, nor where the best way has them already or their order would change.
    fn together(&self, needle: &Needle, best: &Tried) -> Option<Drops> {
        let along_m: Vec<f64> = self.0.iter().map(|(along_m, _)| *along_m).collect();
        let in_order = along_m.windows(2).all(|w| w[1] <= w[0] - APART_M);
        let is_new = needle.loading == Loading::Loose && along_m != best.drops.along_m;
        (is_new && in_order).then(|| Drops {
            along_m,
            ..best.drops.clone()
        })
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
    let mut best = start.clone();
    let mut tried = vec![start.clone()];
    let mut rehearsals = 1;
    // Shortened when a step leads out of the tissue or makes it worse.
    let mut share = 1.0;
    let mut nearest = Nearest::of(&start);
    let mut is_worse = false;
    while rehearsals < limits.rehearsals && best.worst_m() > limits.enough_m {
        let together = nearest.together(needle, &best);
        let drops = match together {
            Some(drops) if is_worse => drops,
            _ => {
                let turn = rehearsals.checked_sub(limits.rehearsals / 2);
                let around = turn.and_then(|turn| nearest.around(needle, &best, turn, limits));
                match around.or_else(|| next(needle, &tried, share, limits)) {
                    Some(drops) if tried.iter().all(|t| t.drops != drops) => drops,
                    _ => break,
                }
            }
        };
        rehearsals += 1;
        match try_it(needle, drops, pace, rehearser) {
            Ok(new) => {
                let is_worse_than_last = tried.last().is_some_and(|last| new.mean_m() > last.mean_m());
                share = if is_worse_than_last { 0.5 * share } else { 1.0 };
                nearest.take(&new);
                is_worse = new.mean_m() >= best.mean_m();
                if !is_worse {
                    best = new.clone();
                }
                tried.push(new);
            }
            // A drop outside the tissue: go less far from the best that worked.
            Err(_) if share > 0.1 => {
                share *= 0.5;
                tried = vec![best.clone()];
            }
            Err(_) => break,
        }
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

fn next(needle: &Needle, tried: &[Tried], share: f64, limits: &Limits) -> Option<Drops> {
    let last = tried.last()?;
    let direction = Vector3::from(needle.direction);
    let seen = |i: usize| {
        tried
            .iter()
            .map(move |t| (t.drops.along_m[i], t.error_m[i].dot(&direction)))
    };
    let count = last.error_m.len();
    let steps_m: Vec<f64> = if needle.loading == Loading::Loose {
        (0..count)
            .map(|i| step_m(&seen(i).collect::<Vec<_>>(), share))
            .collect()
    } else {
        // A strand keeps its pitch: one step for all.
        let middle = |t: &Tried| median(t.error_m.iter().map(|e| e.dot(&direction)).collect());
        let seen: Vec<_> = tried.iter().map(|t| (t.drops.along_m[0], middle(t))).collect();
        vec![step_m(&seen, share); count]
    };
    let mut drops = last.drops.clone();
    for (along_m, step_m) in drops.along_m.iter_mut().zip(&steps_m) {
        *along_m += step_m;
    }
    keep_within(needle, limits, &mut drops);
    aside(needle, last, share, limits, &mut drops);
    Some(drops)
}

/// What a strand is off: moved by that, its seeds are off by the least in the mean, and one that lies far away does not draw the others.
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

/// How much farther to drop a seed than the last time, from where it was dropped and how far along it then lay off, oldest first.
fn step_m(seen: &[(f64, f64)], share: f64) -> f64 {
    let Some((&(drop_m, error_m), before)) = seen.split_last() else {
        return 0.0;
    };
    let recent = &seen[seen.len().saturating_sub(REMEMBERED)..];
    let short = recent.iter().filter(|(_, error_m)| *error_m < 0.0);
    let pairs = short.flat_map(|short| recent.iter().filter(|far| far.1 > 0.0).map(move |far| (short, far)));
    let nearest = pairs
        .filter(|(short, far)| far.0 - short.0 > LEAST_MOVE_M)
        .min_by(|a, b| (a.1.0 - a.0.0).total_cmp(&(b.1.0 - b.0.0)));
    if let Some((short, far)) = nearest {
        let part = (short.1 / (short.1 - far.1)).clamp(KEPT_FROM_ENDS, 1.0 - KEPT_FROM_ENDS);
        return short.0 + part * (far.0 - short.0) - drop_m;
    }
    let slope = before.last().map_or(1.0, |&(drop_before_m, error_before_m)| {
        let moved_m = drop_m - drop_before_m;
        // What the error changed by is what the seed's rest did.
        let slope = (error_m - error_before_m) / moved_m;
        if moved_m.abs() < LEAST_MOVE_M {
            1.0
        } else {
            slope.clamp(SLOPES[0], SLOPES[1])
        }
    });
    -error_m / slope * share
}

/// The needle as a whole moves across by what its seeds are off on average; for next to nothing it stays in its place, where the
/// tissue is ready for it.
fn aside(needle: &Needle, last: &Tried, share: f64, limits: &Limits, drops: &mut Drops) {
    let direction = Vector3::from(needle.direction);
    let sum = last.error_m.iter().fold(Vector3::zeros(), |sum, e| sum + e);
    let mean = sum / last.error_m.len().max(1) as f64;
    let across = mean - direction * mean.dot(&direction);
    if across.norm() < 0.5 * limits.enough_m {
        return;
    }
    let shifted = Vector3::from(drops.entry_m) - across * share - Vector3::from(needle.entry_m);
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
