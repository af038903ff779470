//! Where to drop each seed so that it rests on plan: rehearse, see where the seeds end, drop them elsewhere, rehearse again.
//!
//! What a seed does depends on its own drop and on those before it, not on those that come after. So the deepest seed's drop is
//! sought first, and with that fixed the next one's. The deeper a seed is dropped the deeper it rests, but not in
//! proportion: tissue that sticks to the needle goes along for millimetres, so that many drops leave a seed in one place,
//! and where it lets go a seed's place jumps. A drop is therefore sought between one that leaves the seed short and one that leaves it too far in.
//! Seeds that are not sought yet move along by what they are off, which often is enough. What was found is then rehearsed with
//! stops beside every drop (`edges`).

pub mod edges;
mod search;
mod tried;

use super::rehearse::{Drops, RehearsalError, Rehearser};
use super::{Loading, Needle};
use edges::{Sensitive, keep_clear};
use nalgebra::Vector3;
use search::{DEEPER_M, seek};
use serde::{Deserialize, Serialize};
use stylet_procedure::Pace;
use tried::{Rehearsals, Tried, aside};

/// What compensation may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// A drop is never further from its planned place along the needle.
    pub along_m: f64,
    /// Nor the needle across; 0 keeps it in its hole.
    pub across_m: f64,
    /// Deepest that the tip may go, from the entry.
    pub reach_m: f64,
    /// Rehearsals of one needle at most, the first one included, until its drops are found; those that look for edges come to it.
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
    /// Of them those that looked for edges beside the drops, and for drops clear of them.
    #[serde(default)]
    pub for_edges: usize,
    /// Seeds that are on an edge even so.
    #[serde(default)]
    pub sensitive: Vec<Sensitive>,
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

/// The best way found; dropping as planned where nothing is better. An error when no way was found to go through with the needle.
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
    // Tries that found no way to begin do not count.
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
    let vectors = |t: &Tried| t.error_m.iter().map(|e| (*e).into()).collect();
    Ok(Compensation {
        before_m: is_as_planned.then(|| vectors(&start)),
        after_m: vectors(&best),
        drops: best.drops,
        rehearsals: rehearsals.count,
        for_edges: rehearsals.count - sought,
        sensitive,
    })
}

/// As planned, and whether that could be done; else with drops deeper by the first millimetres that can.
fn start(rehearsals: &mut Rehearsals) -> Result<(Tried, bool), RehearsalError> {
    let (needle, limits) = (rehearsals.needle, rehearsals.limits);
    let planned = Drops::as_planned(needle);
    let why = match rehearsals.try_it(planned.clone()) {
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
        if let Ok(tried) = rehearsals.try_it(drops) {
            return Ok((tried, false));
        }
    }
    Err(why)
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
