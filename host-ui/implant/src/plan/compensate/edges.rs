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

/// Every drop is tried up to so much deeper and so much shallower. A live hand counts as arrived within that distance of its goal
/// (`stylet_procedure::tolerance`); it stops within 0.1 mm of where the rehearsed one does, steps of the encoder and late ticks included.
pub const BESIDE_M: f64 = stylet_procedure::tolerance::AT_TARGET_M;
/// Stops on either side of a drop.
const STOPS: i8 = 2;
/// From one stop to the next.
const STEP_M: f64 = BESIDE_M / STOPS as f64;
/// A seed whose place changes by more than so many times the way between two stops is on an edge. On the way out seeds follow their drops
/// by up to three times as much where nothing gives way; a live hand that stops 0.1 mm from the rehearsed one leaves a seed that is on none
/// within 0.35 mm of where it was rehearsed.
const STEADY: f64 = 3.5;
/// Edges of one needle that are moved away from, one after the other, at most.
const ROUNDS: usize = 3;
/// Rehearsals, at most, that seek the drops of the seeds behind one that was moved.
const SEEK_AGAIN: usize = 12;

/// A seed on an edge: it rests elsewhere if the tip stops up to [`BESIDE_M`] deeper or shallower.
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

/// What one seed does with shallower and with deeper stops.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Beside {
    /// Whether its place jumps somewhere between the stops on that side.
    jumps: [bool; 2],
    /// Farthest that it rests from where it does otherwise, m; infinite where it is lost.
    moves_m: f64,
}

impl Beside {
    /// By where it rests at the stops of one side, the nearest first.
    fn look(&mut self, side: usize, here_m: Vector3<f64>, rests_m: impl Iterator<Item = Vector3<f64>>) {
        let mut last_m = here_m;
        for rest_m in rests_m {
            self.jumps[side] |= (rest_m - last_m).norm() > STEADY * STEP_M;
            self.moves_m = self.moves_m.max((rest_m - here_m).norm());
            last_m = rest_m;
        }
    }

    fn lose(&mut self, side: usize) {
        (self.jumps[side], self.moves_m) = (true, f64::INFINITY);
    }

    fn is_on_edge(&self) -> bool {
        self.jumps.contains(&true)
    }
}

/// What every seed of a needle does.
#[derive(Clone, Debug, PartialEq)]
struct Moves(Vec<Beside>);

impl Moves {
    /// The deepest seed on an edge.
    fn first(&self) -> Option<(usize, [bool; 2])> {
        let each = self.0.iter().map(|beside| beside.jumps);
        each.enumerate().find(|(_, jumps)| jumps.contains(&true))
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

    /// What seeds are off in the mean where every edge is on the wrong side, m.
    fn worst_mean_m(&self, tried: &Tried) -> f64 {
        let each = tried.error_m.iter().zip(&self.0);
        let off = |(error, beside): (&Vector3<f64>, &Beside)| {
            error.norm() + if beside.is_on_edge() { beside.moves_m } else { 0.0 }
        };
        each.map(off).sum::<f64>() / tried.error_m.len().max(1) as f64
    }
}

/// One stop beside a drop: so many steps deeper.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stop {
    seed: usize,
    steps: i8,
    along_m: f64,
}

/// Where the tip stops beside the drops: on the way in before and beyond the first, on the way out beyond and before the others.
fn stops(drops: &Drops, steps: &[i8]) -> Vec<Stop> {
    let beside = |(seed, drop_m): (usize, &f64)| {
        let drop_m = *drop_m;
        steps.iter().map(move |&steps| Stop {
            seed,
            steps,
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

/// One rehearsal with a loose seed at every stop on these sides, 0 shallower and 1 deeper.
fn at_stops(rehearsals: &mut Rehearsals, at: &Tried, sides: &[usize]) -> Result<Moves, RehearsalError> {
    let is_strand = matches!(rehearsals.needle.loading, Loading::Stranded { .. });
    let of_side = |side: usize, step: i8| if side == 0 { -step } else { step };
    let mut steps: Vec<i8> = sides
        .iter()
        .flat_map(|&side| (1..=STOPS).map(move |step| of_side(side, step)))
        .collect();
    // A strand's seeds rest where all of it does, so its seeds are compared with loose ones.
    steps.extend(is_strand.then_some(0));
    let stops = stops(&at.drops, &steps);
    let drops = Drops {
        along_m: stops.iter().map(|stop| stop.along_m).collect(),
        strand_pitch_m: None,
        ..at.drops.clone()
    };
    let rests_m = rehearsals.rests_m(&drops)?;
    let rest_m = |seed: usize, steps: i8| {
        let number = stops.iter().position(|stop| stop.seed == seed && stop.steps == steps)?;
        rests_m.get(number).copied()
    };
    let planned = rehearsals.needle.seeds_m().map(Vector3::from);
    let look = |(seed, (planned_m, error_m)): (usize, (Vector3<f64>, &Vector3<f64>))| {
        let here_m = rest_m(seed, 0).unwrap_or(planned_m + error_m);
        let mut beside = Beside::default();
        for &side in sides {
            beside.look(
                side,
                here_m,
                (1..=STOPS).filter_map(|step| rest_m(seed, of_side(side, step))),
            );
        }
        beside
    };
    Ok(Moves(planned.zip(&at.error_m).enumerate().map(look).collect()))
}

/// All seeds in one rehearsal; where one of them would be left outside the tissue, shallower and deeper apart.
fn look(rehearsals: &mut Rehearsals, at: &Tried) -> Result<Moves, RehearsalError> {
    match at_stops(rehearsals, at, &[0, 1]) {
        Err(RehearsalError::Refused(_)) => {}
        looked => return looked,
    }
    let mut moves = Moves(vec![Beside::default(); at.error_m.len()]);
    // Shallower the last seed may be before the tissue, deeper the first beyond it.
    let last = at.error_m.len().saturating_sub(1);
    for (side, lost) in [(0, last), (1, 0)] {
        match at_stops(rehearsals, at, &[side]) {
            Ok(found) => {
                for (beside, found) in moves.0.iter_mut().zip(&found.0) {
                    beside.jumps[side] = found.jumps[side];
                    beside.moves_m = beside.moves_m.max(found.moves_m);
                }
            }
            Err(RehearsalError::Refused(_)) => moves.0[lost].lose(side),
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
        // An edge lies somewhere between here and the last stop on that side: the next drop is clear of it by as much.
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
