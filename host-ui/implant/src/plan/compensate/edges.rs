//! Edges: drops beside which the tissue does something else, so that a tip that stops a little deeper or shallower than it
//! should leaves its seed elsewhere.
//!
//! A membrane that gives way, or a layer that ends in front of the tip, moves the tissue by millimetres at one place of the tip. A
//! rehearsal stops at one place; a live hand stops near it.

use super::search::seek;
use super::tried::{Rehearsals, Tried, keep_within};
use crate::plan::Loading;
use crate::plan::rehearse::{Drops, RehearsalError};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Every drop is tried so much deeper and so much shallower. A live hand counts as arrived within that distance of its goal
/// (`stylet_procedure::tolerance`); it stops within 0.1 mm of where the rehearsed one does, steps of the encoder and late ticks included.
pub const BESIDE_M: f64 = stylet_procedure::tolerance::AT_TARGET_M;
/// A seed whose place changes by more than so many times the change of its drop is on an edge.
const STEADY: f64 = 2.0;
/// Edges of one needle that are moved away from, one after the other, at most.
const ROUNDS: usize = 3;
/// Rehearsals, at most, that seek the drops of the seeds behind one that was moved.
const SEEK_AGAIN: usize = 12;

/// A seed on an edge: it rests elsewhere if the tip stops [`BESIDE_M`] deeper or shallower.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sensitive {
    /// Number of the seed, deepest first.
    pub seed: usize,
    /// How far from where it rests otherwise, m; `None` where it would be left outside the tissue.
    pub moves_m: Option<f64>,
}

impl std::fmt::Display for Sensitive {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (number, beside_mm) = (self.seed + 1, BESIDE_M * 1e3);
        match self.moves_m {
            Some(m) => write!(
                f,
                "seed {number} is sensitive: it rests {:.1} mm elsewhere if the tip stops {beside_mm:.1} mm deeper or shallower",
                m * 1e3
            ),
            None => write!(
                f,
                "seed {number} is sensitive: it is lost if the tip stops {beside_mm:.1} mm deeper or shallower"
            ),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Shallower,
    Here,
    Deeper,
}

impl Side {
    fn aside_m(self) -> f64 {
        match self {
            Side::Shallower => -BESIDE_M,
            Side::Here => 0.0,
            Side::Deeper => BESIDE_M,
        }
    }
}

/// How far each seed rests from where it does otherwise, with a shallower and a deeper drop; infinite where it is lost.
#[derive(Clone, Debug, PartialEq)]
struct Moves(Vec<[f64; 2]>);

impl Moves {
    fn is_edge(moves_m: f64) -> bool {
        moves_m > STEADY * BESIDE_M
    }

    /// The deepest seed on an edge.
    fn first(&self) -> Option<(usize, [bool; 2])> {
        let each = self.0.iter().map(|sides| sides.map(Self::is_edge));
        each.enumerate().find(|(_, sides)| sides.contains(&true))
    }

    fn sensitive(&self) -> Vec<Sensitive> {
        let each = self.0.iter().map(|sides| sides[0].max(sides[1])).enumerate();
        each.filter(|(_, moves_m)| Self::is_edge(*moves_m))
            .map(|(seed, moves_m)| Sensitive {
                seed,
                moves_m: moves_m.is_finite().then_some(moves_m),
            })
            .collect()
    }

    /// What seeds are off in the mean where every edge is on the wrong side, m.
    fn worst_mean_m(&self, tried: &Tried) -> f64 {
        let each = tried.error_m.iter().zip(&self.0);
        let off = |(error, sides): (&Vector3<f64>, &[f64; 2])| {
            let moves_m = sides[0].max(sides[1]);
            error.norm() + if Self::is_edge(moves_m) { moves_m } else { 0.0 }
        };
        each.map(off).sum::<f64>() / tried.error_m.len().max(1) as f64
    }
}

/// Where the tip stops beside the drops: on the way in before, at and beyond the first, on the way out beyond and before the others.
fn stops(drops: &Drops, sides: &[Side]) -> Vec<(usize, Side, f64)> {
    let beside = |(seed, along_m): (usize, &f64)| {
        let along_m = *along_m;
        sides.iter().map(move |side| (seed, *side, along_m + side.aside_m()))
    };
    let mut stops: Vec<_> = drops.along_m.iter().enumerate().flat_map(beside).collect();
    let way_in = |&(seed, _, along_m): &(usize, Side, f64)| (seed > 0, if seed > 0 { -along_m } else { along_m });
    stops.sort_by(|a, b| {
        let (a, b) = (way_in(a), way_in(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    stops
}

/// One rehearsal with a loose seed at every stop: how far each rests from where it does otherwise.
fn at_stops(rehearsals: &mut Rehearsals, at: &Tried, sides: &[Side]) -> Result<Moves, RehearsalError> {
    let is_strand = matches!(rehearsals.needle.loading, Loading::Stranded { .. });
    // A strand's seeds rest where all of it does, so seeds are compared that are not in one.
    let sides: Vec<Side> = sides.iter().copied().chain(is_strand.then_some(Side::Here)).collect();
    let stops = stops(&at.drops, &sides);
    let drops = Drops {
        along_m: stops.iter().map(|(_, _, along_m)| *along_m).collect(),
        strand_pitch_m: None,
        ..at.drops.clone()
    };
    let rests_m = rehearsals.rests_m(&drops)?;
    let rest_m = |seed: usize, side: Side| {
        let number = stops.iter().position(|(s, of, _)| (*s, *of) == (seed, side))?;
        rests_m.get(number).copied()
    };
    let planned: Vec<Vector3<f64>> = rehearsals.needle.seeds_m().map(Vector3::from).collect();
    let moves_m = |seed: usize, side: Side| {
        let here_m = match is_strand {
            true => rest_m(seed, Side::Here)?,
            false => planned.get(seed)? + at.error_m.get(seed)?,
        };
        Some((rest_m(seed, side)? - here_m).norm())
    };
    let each = |seed| [Side::Shallower, Side::Deeper].map(|side| moves_m(seed, side).unwrap_or(0.0));
    Ok(Moves((0..at.error_m.len()).map(each).collect()))
}

/// All seeds in one rehearsal; where one of them would be left outside the tissue, deeper and shallower apart.
fn look(rehearsals: &mut Rehearsals, at: &Tried) -> Result<Moves, RehearsalError> {
    match at_stops(rehearsals, at, &[Side::Shallower, Side::Deeper]) {
        Err(RehearsalError::Refused(_)) => {}
        looked => return looked,
    }
    let mut moves = Moves(vec![[0.0; 2]; at.error_m.len()]);
    // Deeper the first seed may be beyond the tissue, shallower the last before it.
    let last = at.error_m.len().saturating_sub(1);
    for (n, side, lost) in [(0, Side::Shallower, last), (1, Side::Deeper, 0)] {
        match at_stops(rehearsals, at, &[side]) {
            Ok(found) => {
                for (seed, sides) in found.0.iter().enumerate() {
                    moves.0[seed][n] = sides[n];
                }
            }
            Err(RehearsalError::Refused(_)) => moves.0[lost][n] = f64::INFINITY,
            Err(why) => return Err(why),
        }
    }
    Ok(moves)
}

/// The same drops with that seed moved along, and those behind it sought again; `None` where it cannot be dropped there.
fn moved_along(rehearsals: &mut Rehearsals, from: &Tried, seed: usize, by_m: f64) -> Option<Tried> {
    let mut drops = from.drops.clone();
    match rehearsals.needle.loading {
        Loading::Loose => drops.along_m[seed] += by_m,
        Loading::Stranded { .. } => drops.along_m.iter_mut().for_each(|along_m| *along_m += by_m),
    }
    keep_within(rehearsals.needle, rehearsals.limits, &mut drops);
    let tried = rehearsals.try_it(drops).ok()?;
    Some(seek(rehearsals, seed + 1, tried.clone(), tried, SEEK_AGAIN))
}

/// Drops clear of edges, as far as there are such: moved to the side on which less is lost. Beside them the seeds that are on an
/// edge even so.
pub(super) fn keep_clear(rehearsals: &mut Rehearsals, found: Tried) -> Result<(Tried, Vec<Sensitive>), RehearsalError> {
    let mut moves = look(rehearsals, &found)?;
    let mut best = found;
    for _ in 0..ROUNDS {
        let Some((seed, [before, beyond])) = moves.first() else {
            break;
        };
        // From an edge somewhere between here and the stop on that side, the next drop is as far as the stops.
        let shallower_m = if before { -2.0 * BESIDE_M } else { -BESIDE_M };
        let deeper_m = if beyond { 2.0 * BESIDE_M } else { BESIDE_M };
        let mut better = None;
        let mut least_m = moves.worst_mean_m(&best);
        for by_m in [shallower_m, deeper_m] {
            let Some(tried) = moved_along(rehearsals, &best, seed, by_m) else {
                continue;
            };
            let found = look(rehearsals, &tried)?;
            let worst_m = found.worst_mean_m(&tried);
            if worst_m < least_m {
                least_m = worst_m;
                better = Some((tried, found));
            }
        }
        let Some((tried, found)) = better else { break };
        (best, moves) = (tried, found);
    }
    Ok((best, moves.sensitive()))
}
