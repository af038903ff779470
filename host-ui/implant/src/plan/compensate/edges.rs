//! Edges: drops near which the tissue behaves differently, so that a tip that stops a little deeper
//! or shallower leaves its seed elsewhere.
//!
//! A membrane that gives way, or a layer that ends in front of the tip, moves the tissue by
//! millimetres at one place of the tip. A rehearsal stops at one place; a live hand stops near it.

use super::rehearsals::{Rehearsals, RehearsedDrops, SeedAtRest, keep_within};
use super::search::seek;
use crate::plan::Loading;
use crate::plan::rehearse::{Drops, RehearsalError};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_shm_schema::MAX_SEEDS;

/// Distance from a drop, deeper or shallower, within which edges are searched. A live hand counts
/// as arrived within that distance of its goal (`stylet_procedure::tolerance`). It stops within 0.1
/// mm of the rehearsed one, steps of the encoder and late ticks included.
pub const EDGE_REACH_M: f64 = stylet_procedure::tolerance::AT_TARGET_M;
/// Distance between stops near a drop.
const STEP_M: f64 = 0.5 * EDGE_REACH_M;
/// Number of stops on either side: a hand that sticks arrives up to [`EDGE_REACH_M`] before its goal,
/// so they extend twice as far.
const STOPS: i8 = 4;
/// Largest ratio by which a seed follows its drop between two stops, with a small allowance; beyond
/// it there is an edge. A live hand that stops 0.1 mm from the rehearsed one leaves a seed without
/// an edge within 0.35 mm of its rehearsed place.
const STEADY: f64 = 2.0;
const UNSTEADY_M: f64 = 0.15e-3;
/// Distance below which places are equal.
const SAME_M: f64 = 1e-9;
/// Most edges of one needle that are avoided, one after the other.
const ROUNDS: usize = 3;
/// Most steps to one side until a drop is clear there.
const STEPS_ASIDE: usize = 3;
/// Most rehearsals that search the drops of the seeds after one that was moved.
const SEEK_AGAIN: usize = 12;

/// Seed on an edge: it rests elsewhere if the tip stops up to [`EDGE_REACH_M`] deeper or shallower.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sensitive {
    /// Number of the seed, deepest first.
    pub seed: usize,
    /// Distance from its usual place at rest, m; `None` if it would be left outside the tissue.
    pub moves_m: Option<f64>,
}

impl std::fmt::Display for Sensitive {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (number, beside_mm) = (self.seed + 1, EDGE_REACH_M * 1e3);
        match self.moves_m {
            Some(m) => write!(
                f,
                "seed {number} is sensitive: it rests up to {:.1} mm elsewhere if the tip stops up to {beside_mm:.1} mm deeper or shallower",
                m * 1e3
            ),
            None => write!(
                f,
                "seed {number} is sensitive: it is lost if the tip stops up to {beside_mm:.1} mm deeper or shallower"
            ),
        }
    }
}

/// Edge between two stops on one side of a drop: distances of the tip from it.
type Edge = Option<[f64; 2]>;

/// Response of one seed to shallower and deeper stops.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct EdgeResponse {
    /// Nearest edge on each side.
    edges: [Edge; 2],
    /// Largest displacement beyond an edge, m; infinite for a lost seed.
    moves_m: f64,
}

impl EdgeResponse {
    /// Evaluates a seed that is dropped with the tip at `tip_m`, by its places for the stops
    /// around.
    fn of(tip_m: f64, mut stops: Vec<SeedAtRest>) -> Self {
        stops.sort_by(|a, b| a.tip_m.total_cmp(&b.tip_m));
        let mut beside = Self::default();
        for pair in stops.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let moved_m = (to.rest_m - from.rest_m).norm();
            let [low_m, high_m] = [from.tip_m - tip_m, to.tip_m - tip_m];
            let is_near = low_m < EDGE_REACH_M - SAME_M && high_m > SAME_M - EDGE_REACH_M;
            if is_near && moved_m > STEADY * (high_m - low_m) + UNSTEADY_M {
                beside.moves_m = beside.moves_m.max(moved_m);
                // Of several on one side the nearest counts.
                if low_m < -SAME_M {
                    beside.edges[0] = Some([(-high_m).max(0.0), -low_m]);
                }
                if high_m > SAME_M {
                    beside.edges[1].get_or_insert([low_m.max(0.0), high_m]);
                }
            }
        }
        beside
    }

    fn merge(&mut self, other: &Self) {
        for (edge, other) in self.edges.iter_mut().zip(other.edges) {
            *edge = edge.or(other);
        }
        self.moves_m = self.moves_m.max(other.moves_m);
    }

    /// Marks the seed as left outside the tissue.
    fn lose(&mut self, side: usize) {
        (self.edges[side], self.moves_m) = (Some([0.0, EDGE_REACH_M]), f64::INFINITY);
    }

    fn is_on_edge(&self) -> bool {
        self.edges.iter().any(Option::is_some)
    }

    /// Returns the shift to that side at which the drop is clear of the nearest edge by
    /// [`EDGE_REACH_M`]; `None` if there is none.
    fn way_m(&self, side: usize) -> Option<f64> {
        let sign = if side == 0 { -1.0 } else { 1.0 };
        let clear_m = match (self.edges[side], self.edges[1 - side]) {
            // Beyond the edge on that side.
            (Some([_, far_m]), _) => far_m + EDGE_REACH_M,
            // Away from the one on the other side.
            (None, Some([near_m, _])) => EDGE_REACH_M - near_m,
            (None, None) => return None,
        };
        Some(sign * clear_m)
    }
}

/// Response of every seed of a needle.
#[derive(Clone, Debug, PartialEq)]
struct EdgeResponses(Vec<EdgeResponse>);

impl EdgeResponses {
    /// Returns the deepest seed on an edge.
    fn first(&self) -> Option<usize> {
        self.0.iter().position(EdgeResponse::is_on_edge)
    }

    fn sensitive(&self) -> Vec<Sensitive> {
        let each = self.0.iter().enumerate();
        each.filter(|(_, beside)| beside.is_on_edge())
            .map(|(seed, beside)| Sensitive {
                seed,
                moves_m: beside.moves_m.is_finite().then_some(beside.moves_m),
            })
            .collect()
    }

    /// Returns the mean error of the seeds if every edge is on the wrong side, m.
    fn worst_mean_m(&self, tried: &RehearsedDrops) -> f64 {
        let each = tried.error_m.iter().zip(&self.0);
        let off = |(error, beside): (&Vector3<f64>, &EdgeResponse)| {
            error.norm() + if beside.is_on_edge() { beside.moves_m } else { 0.0 }
        };
        each.map(off).sum::<f64>() / tried.error_m.len().max(1) as f64
    }
}

/// Stop near a drop.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stop {
    seed: usize,
    along_m: f64,
}

/// Returns the stops around the drops: on the way in from before the first to beyond it, on the way
/// out from beyond to before the others.
fn stops(drops: &Drops, steps: &[i8]) -> Vec<Stop> {
    let beside = |(seed, drop_m): (usize, &f64)| {
        let drop_m = *drop_m;
        steps.iter().map(move |&steps| Stop {
            seed,
            along_m: drop_m + f64::from(steps) * STEP_M,
        })
    };
    let mut stops: Vec<Stop> = drops.along_m.iter().enumerate().flat_map(beside).collect();
    let order = |stop: &Stop| match stop.seed {
        0 => (false, stop.along_m),
        _ => (true, -stop.along_m),
    };
    stops.sort_by(|a, b| {
        let (a, b) = (order(a), order(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    stops
}

/// Rehearses with a loose seed at every drop and at every stop around it, by these numbers of steps
/// shallower and deeper. They are nearer to each other than a seed is long, so they take no room.
fn at_stops(
    rehearsals: &mut Rehearsals,
    at: &RehearsedDrops,
    [shallower, deeper]: [i8; 2],
) -> Result<EdgeResponses, RehearsalError> {
    let steps: Vec<i8> = (-shallower..=deeper).collect();
    let mut stops = stops(&at.drops, &steps);
    stops.truncate(MAX_SEEDS);
    let drops = Drops {
        along_m: stops.iter().map(|stop| stop.along_m).collect(),
        // A strand's seeds rest where all of it does.
        strand_pitch_m: None,
        ..at.drops.clone()
    };
    let left = rehearsals.left(&drops, true)?;
    let of = |seed: usize| {
        stops
            .iter()
            .zip(&left)
            .filter(move |(stop, _)| stop.seed == seed)
            .map(|(_, left)| *left)
    };
    let look = |(seed, here): (usize, &SeedAtRest)| EdgeResponse::of(here.tip_m, of(seed).collect());
    Ok(EdgeResponses(at.left.iter().enumerate().map(look).collect()))
}

/// Rehearses all seeds at once; if one of them would be left outside the tissue, with fewer stops,
/// then shallower and deeper separately.
fn look(rehearsals: &mut Rehearsals, at: &RehearsedDrops) -> Result<EdgeResponses, RehearsalError> {
    for steps in [STOPS, STOPS / 2] {
        match at_stops(rehearsals, at, [steps; 2]) {
            Err(RehearsalError::Refused { .. }) => {}
            looked => return looked,
        }
    }
    let mut moves = EdgeResponses(vec![EdgeResponse::default(); at.error_m.len()]);
    // A shallower last seed may be before the tissue, a deeper first one beyond it.
    let last = at.error_m.len().saturating_sub(1);
    for (side, steps, lost) in [(0, [STOPS / 2, 0], last), (1, [0, STOPS / 2], 0)] {
        match at_stops(rehearsals, at, steps) {
            Ok(found) => moves
                .0
                .iter_mut()
                .zip(&found.0)
                .for_each(|(beside, found)| beside.merge(found)),
            Err(RehearsalError::Refused { .. }) => moves.0[lost].lose(side),
            Err(why) => return Err(why),
        }
    }
    Ok(moves)
}

/// Returns the same drops with that seed shifted, and later ones searched again; `None` if it
/// cannot be dropped there.
fn moved_along(rehearsals: &mut Rehearsals, from: &RehearsedDrops, seed: usize, by_m: f64) -> Option<RehearsedDrops> {
    let mut drops = from.drops.clone();
    match rehearsals.needle.loading {
        Loading::Loose => drops.along_m[seed] += by_m,
        Loading::Stranded { .. } => drops.along_m.iter_mut().for_each(|along_m| *along_m += by_m),
    }
    keep_within(rehearsals.needle, rehearsals.limits, &mut drops);
    let tried = rehearsals.try_it(drops).ok()?;
    Some(seek(rehearsals, seed + 1, tried.clone(), tried, SEEK_AGAIN))
}

/// Moves the drop of that seed to one side until it is clear of the edges there. A hand that sticks
/// stops at its old place, so one step may not be enough.
fn to_side(
    rehearsals: &mut Rehearsals,
    from: &RehearsedDrops,
    moves: &EdgeResponses,
    (seed, side): (usize, usize),
) -> Result<Option<(RehearsedDrops, EdgeResponses)>, RehearsalError> {
    let mut by_m = 0.0;
    let mut at: Option<(RehearsedDrops, EdgeResponses)> = None;
    for _ in 0..STEPS_ASIDE {
        let beside = at.as_ref().map_or(&moves.0[seed], |(_, moves)| &moves.0[seed]);
        let Some(more_m) = beside.way_m(side) else { break };
        by_m += match at {
            Some(_) => more_m + STEP_M.copysign(more_m),
            None => more_m,
        };
        let Some(tried) = moved_along(rehearsals, from, seed, by_m) else {
            break;
        };
        let moves = look(rehearsals, &tried)?;
        at = Some((tried, moves));
    }
    Ok(at)
}

/// Returns drops clear of edges, as far as possible, moved to the side with the smaller loss; and
/// the seeds that are still on an edge.
pub(super) fn keep_clear(
    rehearsals: &mut Rehearsals,
    found: RehearsedDrops,
) -> Result<(RehearsedDrops, Vec<Sensitive>), RehearsalError> {
    let mut moves = look(rehearsals, &found)?;
    let mut best = found;
    for _ in 0..ROUNDS {
        let Some(seed) = moves.first() else { break };
        let mut better = None;
        let mut least_m = moves.worst_mean_m(&best);
        for side in [0, 1] {
            let Some((tried, found)) = to_side(rehearsals, &best, &moves, (seed, side))? else {
                continue;
            };
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
