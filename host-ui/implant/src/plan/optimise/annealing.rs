//! Simulated annealing: random moves of seeds and needles; worse ones are accepted ever more rarely
//! (Kirkpatrick, Gelatt, Vecchi, Science 220, 671, 1983).

use super::state::{Move, State};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::ops::ControlFlow;

/// Random seed, constant so that one input gives one plan.
const SEED: u64 = 0x5eed;
/// Number of moves between two reports.
const REPORT_EVERY: usize = 200;

/// Length and temperatures of an annealing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// Number of tried moves.
    pub moves: usize,
    /// Cost increases that are accepted with probability 1/e, at first and at last.
    pub temperatures: [f32; 2],
}

/// Anneals; ends with the best choice found.
pub fn anneal(state: &mut State, schedule: &Schedule, report: &dyn Fn(f32) -> ControlFlow<()>) -> ControlFlow<()> {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let mut best = state.clone();
    let [first, last] = schedule.temperatures;
    for step in 0..schedule.moves {
        let share = step as f32 / schedule.moves as f32;
        if step % REPORT_EVERY == 0 {
            report(share)?;
        }
        let temperature = first * (last / first).powf(share);
        let Some(change) = propose(state, &mut random) else {
            continue;
        };
        let Some(cost) = state.try_move(&change) else { continue };
        if cost <= state.cost || unit(&mut random) < (-(cost - state.cost) / temperature).exp() {
            state.accept(&change, cost);
            if state.cost < best.cost - 1e-5 {
                best.clone_from(state);
            }
        }
    }
    *state = best;
    ControlFlow::Continue(())
}

fn unit(random: &mut ChaCha8Rng) -> f32 {
    (random.next_u32() >> 8) as f32 / (1 << 24) as f32
}

fn below(random: &mut ChaCha8Rng, count: usize) -> Option<usize> {
    (count > 0).then(|| ((u64::from(random.next_u32()) * count as u64) >> 32) as usize)
}

fn propose(state: &State, random: &mut ChaCha8Rng) -> Option<Move> {
    let strength = state.strength;
    let change = |without: Vec<usize>, with: Vec<usize>| {
        Some(Move {
            without,
            with,
            strength,
        })
    };
    match below(random, 100)? {
        0..35 => {
            let seed = any_seed(state, random)?;
            change(vec![seed], vec![along(state, seed, random)?])
        }
        35..60 => {
            let seed = any_seed(state, random)?;
            change(vec![seed], vec![on_used_way(state, random)?])
        }
        60..68 => change(vec![any_seed(state, random)?], Vec::new()),
        68..76 => change(Vec::new(), vec![on_used_way(state, random)?]),
        76..90 => needle_aside(state, random),
        90..98 => new_needle(state, random),
        _ => {
            let up = random.next_u32() & 1 == 1;
            let strength = if up { strength + 1 } else { strength.checked_sub(1)? };
            let one = if up {
                any_seed(state, random)?
            } else {
                on_used_way(state, random)?
            };
            // Stronger seeds need fewer.
            let [without, with] = if up {
                [vec![one], Vec::new()]
            } else {
                [Vec::new(), vec![one]]
            };
            (strength < state.strengths()).then_some(Move {
                without,
                with,
                strength,
            })
        }
    }
}

fn any_seed(state: &State, random: &mut ChaCha8Rng) -> Option<usize> {
    below(random, state.seeds.len()).map(|n| state.seeds[n])
}

/// Returns a free place one or two places on, along the same needle.
fn along(state: &State, seed: usize, random: &mut ChaCha8Rng) -> Option<usize> {
    let places = &state.candidates.ways[state.candidates.places[seed].way].places;
    let by = below(random, 2)? + 1;
    let to = if random.next_u32() & 1 == 1 {
        seed + by
    } else {
        seed.checked_sub(by)?
    };
    (places.contains(&to) && !state.chosen[to]).then_some(to)
}

/// Returns a free place on a needle that has seeds.
fn on_used_way(state: &State, random: &mut ChaCha8Rng) -> Option<usize> {
    let way = state.candidates.places[any_seed(state, random)?].way;
    let places = &state.candidates.ways[way].places;
    let place = places.start + below(random, places.len())?;
    (!state.chosen[place]).then_some(place)
}

/// Returns all seeds of a needle through one of the eight holes around it.
fn needle_aside(state: &State, random: &mut ChaCha8Rng) -> Option<Move> {
    let candidates = state.candidates;
    let from = candidates.places[any_seed(state, random)?].way;
    let step = [-1, 0, 1].map(|s: i8| s);
    let beside = [step[below(random, 3)?], step[below(random, 3)?]];
    let hole = candidates.ways[from].hole.offset_by(beside)?;
    let to = candidates.ways.iter().position(|way| way.hole == hole)?;
    if state.of_way[to] > 0 {
        return None;
    }
    let without: Vec<usize> = candidates.ways[from]
        .places
        .clone()
        .filter(|&p| state.chosen[p])
        .collect();
    Some(Move {
        with: nearest_places(state, &without, to),
        without,
        strength: state.strength,
    })
}

/// Returns the places at the same depths on another needle line; two that would coincide become
/// one.
fn nearest_places(state: &State, places: &[usize], way: usize) -> Vec<usize> {
    let candidates = state.candidates;
    let off_m = |p: usize, along_m: f64| (candidates.places[p].along_m - along_m).abs();
    let nearest = |&place: &usize| {
        let along_m = candidates.places[place].along_m;
        candidates.ways[way]
            .places
            .clone()
            .min_by(|&a, &b| off_m(a, along_m).total_cmp(&off_m(b, along_m)))
    };
    let mut found: Vec<usize> = places.iter().filter_map(nearest).collect();
    found.dedup();
    found
}

/// Moves the seeds of a needle to an unused hole.
fn new_needle(state: &State, random: &mut ChaCha8Rng) -> Option<Move> {
    let to = below(random, state.of_way.len())?;
    if state.of_way[to] > 0 {
        return None;
    }
    let from = state.candidates.places[any_seed(state, random)?].way;
    let of_from = state.candidates.ways[from].places.clone();
    let seeds: Vec<usize> = of_from.filter(|&p| state.chosen[p]).collect();
    let adds = state.needles < state.limits.needles && random.next_u32() & 1 == 1;
    Some(Move {
        with: nearest_places(state, &seeds, to),
        without: if adds { Vec::new() } else { seeds },
        strength: state.strength,
    })
}
