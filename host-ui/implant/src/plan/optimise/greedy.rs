//! Greedy search with exchange: adds the most helpful seed, one after the other, then moves single
//! seeds while that helps.

use super::state::{Move, State};
use std::ops::ControlFlow;

/// Adds the seed that reduces the cost most, until none does.
pub fn build(state: &mut State, report: &dyn Fn(f32) -> ControlFlow<()>) -> ControlFlow<()> {
    loop {
        report(0.0)?;
        let (strength, free) = (state.strength, free_places(state));
        let change = |place| Move {
            without: Vec::new(),
            with: vec![place],
            strength,
        };
        if !take_best(state, &free.into_iter().map(change).collect::<Vec<_>>()) {
            return ControlFlow::Continue(());
        }
    }
}

/// Applies the best of removing a seed and of moving it to any other place, seed by seed, then new
/// seeds and another strength if they help.
pub fn exchange(state: &mut State, report: &dyn Fn(f32) -> ControlFlow<()>) -> ControlFlow<()> {
    let seeds = state.seeds.clone();
    for (number, &seed) in seeds.iter().enumerate() {
        report(number as f32 / seeds.len() as f32)?;
        exchange_one(state, seed);
    }
    build(state, &|_| report(1.0))?;
    for strength in [state.strength.saturating_sub(1), state.strength + 1] {
        if strength < state.strengths() {
            state.take_if_better(&Move {
                strength,
                ..Move::default()
            });
        }
    }
    ControlFlow::Continue(())
}

fn exchange_one(state: &mut State, seed: usize) {
    let strength = state.strength;
    let change = |with: Vec<usize>| Move {
        without: vec![seed],
        with,
        strength,
    };
    let to_places = free_places(state).into_iter().map(|place| change(vec![place]));
    let moves: Vec<Move> = std::iter::once(change(Vec::new())).chain(to_places).collect();
    take_best(state, &moves);
}

fn free_places(state: &State) -> Vec<usize> {
    (0..state.chosen.len()).filter(|&place| !state.chosen[place]).collect()
}

fn take_best(state: &mut State, moves: &[Move]) -> bool {
    match state.best_of(moves) {
        Some((best, _)) => state.take_if_better(&moves[best]),
        None => false,
    }
}
