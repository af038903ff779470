//! Search for drops that let each seed rest on plan: rehearse, compare the places at rest, shift
//! the drops, rehearse again.
//!
//! A seed's place depends on its own drop and on earlier ones, not on later ones. So the deepest
//! seed's drop is searched first, and with that fixed the next one's. The deeper a seed is dropped
//! the deeper it rests, but not in proportion. Tissue that sticks to the needle moves along for
//! millimetres, so that many drops leave a seed in one place; when it slips, a seed's place jumps.
//! A drop is therefore searched between one that leaves the seed short and one that leaves it too
//! deep. Later seeds shift along by their own error, which often is enough. The result is then
//! rehearsed with stops near every drop (`edges`).

pub mod edges;
mod rehearsals;
mod search;

use super::rehearse::{Drops, RehearsalError, Rehearser};
use super::{Loading, Needle};
use edges::{Sensitive, keep_clear};
use nalgebra::Vector3;
use rehearsals::{Rehearsals, RehearsedDrops, aside};
use search::{DEEPER_M, seek};
use serde::{Deserialize, Serialize};
use stylet_procedure::Pace;

/// Limits of compensation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest shift of a drop along the needle.
    pub along_m: f64,
    /// Largest shift of the needle across; 0 keeps it in its hole.
    pub across_m: f64,
    /// Deepest that the needle may leave the middle of a seed, from the entry.
    pub reach_m: f64,
    /// Most rehearsals of one needle, the first one included, until its drops are found; those for
    /// edges are extra.
    pub rehearsals: usize,
    /// Largest error of a seed that is good enough.
    pub enough_m: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            along_m: 15e-3,
            across_m: 1.5e-3,
            reach_m: super::check::DEEPEST_SEED_M,
            rehearsals: 30,
            enough_m: 0.1e-3,
        }
    }
}

/// Compensation of one needle, with its errors before and after.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compensation {
    /// Drops with the smallest errors.
    pub drops: Drops,
    /// Rest minus plan of each seed, deepest first, when dropped as planned. `None` if that is
    /// impossible, because the tip would be outside the tissue, which has moved ahead.
    pub before_m: Option<Vec<[f64; 3]>>,
    /// Rest minus plan when dropped as in `drops`.
    pub after_m: Vec<[f64; 3]>,
    /// Number of rehearsals.
    pub rehearsals: usize,
    /// Number of those that searched for edges near the drops, and for drops clear of them.
    #[serde(default)]
    pub for_edges: usize,
    /// Seeds that are still on an edge.
    #[serde(default)]
    pub sensitive: Vec<Sensitive>,
}

impl Compensation {
    /// Returns the distance of each seed from plan when dropped as planned, m.
    pub fn errors_before_m(&self) -> impl Iterator<Item = f64> + '_ {
        self.before_m.iter().flatten().map(|e| Vector3::from(*e).norm())
    }

    /// Returns the distance of each seed from plan with the compensated drops, m.
    pub fn errors_after_m(&self) -> impl Iterator<Item = f64> + '_ {
        self.after_m.iter().map(|e| Vector3::from(*e).norm())
    }
}

/// Returns the best drops found; the planned ones if nothing is better. Returns an error if the
/// needle could not be completed in any way.
pub fn compensate(
    needle: &Needle,
    pace: &Pace,
    limits: &Limits,
    rehearser: &mut dyn Rehearser,
) -> Result<Compensation, RehearsalError> {
    let mut rehearsals = Rehearsals {
        needle,
        pace,
        limits,
        rehearser,
        count: 0,
    };
    let (start, is_as_planned) = start(&mut rehearsals)?;
    // Attempts that could not begin do not count.
    let until = rehearsals.count - 1 + limits.rehearsals;
    let (mut best, mut last) = (start.clone(), start.clone());
    let mut drops = start.drops.clone();
    aside(needle, &start, limits, &mut drops);
    if drops != start.drops
        && let Ok(new) = rehearsals.try_it(drops)
    {
        if new.mean_m() < best.mean_m() {
            best = new.clone();
        }
        last = new;
    }
    let most = until.saturating_sub(rehearsals.count);
    let best = seek(&mut rehearsals, 0, best, last, most);
    let sought = rehearsals.count;
    let (best, sensitive) = keep_clear(&mut rehearsals, best)?;
    let vectors = |t: &RehearsedDrops| t.error_m.iter().map(|e| (*e).into()).collect();
    Ok(Compensation {
        before_m: is_as_planned.then(|| vectors(&start)),
        after_m: vectors(&best),
        drops: best.drops,
        rehearsals: rehearsals.count,
        for_edges: rehearsals.count - sought,
        sensitive,
    })
}

/// Rehearses the planned drops, and returns whether they are possible; else shifts them deeper
/// until they are.
fn start(rehearsals: &mut Rehearsals) -> Result<(RehearsedDrops, bool), RehearsalError> {
    let (needle, limits) = (rehearsals.needle, rehearsals.limits);
    let planned = Drops::as_planned(needle);
    let why = match rehearsals.try_it(planned.clone()) {
        Ok(tried) => return Ok((tried, true)),
        Err(why) => why,
    };
    let last = planned.along_m.len().saturating_sub(1).max(1) as f64;
    // All equally; or, for loose seeds, the last one most: the first may be near the far end of the
    // tissue.
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
        if let Ok(tried) = rehearsals.try_it(drops) {
            return Ok((tried, false));
        }
    }
    Err(why)
}

/// Returns mean and largest errors: before, of the needles that can be dropped as planned; after,
/// of all.
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
