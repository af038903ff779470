//! Greedy with exchange: the seed that helps most, one after the other, then moves of one seed as long as one of them helps.

use super::state::{Move, State};
use std::ops::ControlFlow;

/// Adds the seed that makes the cost smallest until none does.
pub fn build(state: &mut State, report: &dyn Fn(f32) -> ControlFlow<()>) -> ControlFlow<()> {
    loop {
        report(0.0)?;
        let mut best: Option<(f32, Move)> = None;
        for place in (0..state.chosen.len())
            .filter(|&place| !state.chosen[place])
            .collect::<Vec<_>>()
        {
            let change = Move {
                without: Vec::new(),
                with: vec![place],
                strength: state.strength,
            };
            if let Some(cost) = state.try_move(&change)
                && cost < best.as_ref().map_or(state.cost - 1e-6, |(least, _)| *least)
            {
                best = Some((cost, change));
            }
        }
        let Some((_, change)) = best else {
            return ControlFlow::Continue(());
        };
        state.take_if_better(&change);
    }
}

/// Takes the first move of a seed to any other place, its removal, a new seed or another strength that helps, until none does or
/// for so many rounds over all seeds.
pub fn exchange(state: &mut State, rounds: usize, report: &dyn Fn(f32) -> ControlFlow<()>) -> ControlFlow<()> {
    for round in 0..rounds {
        let before = state.cost;
        let seeds = state.seeds.clone();
        for (number, &seed) in seeds.iter().enumerate() {
            report((round as f32 + number as f32 / seeds.len() as f32) / rounds as f32)?;
            exchange_one(state, seed);
        }
        build(state, &|_| report((round + 1) as f32 / rounds as f32))?;
        for strength in [state.strength.saturating_sub(1), state.strength + 1] {
            if strength < state.strengths() {
                state.take_if_better(&Move {
                    strength,
                    ..Move::default()
                });
            }
        }
        if state.cost > before - 1e-4 {
            break;
        }
    }
    ControlFlow::Continue(())
}

fn exchange_one(state: &mut State, seed: usize) {
    let strength = state.strength;
    let without = vec![seed];
    let removed = Move {
        without: without.clone(),
        with: Vec::new(),
        strength,
    };
    if state.take_if_better(&removed) {
        return;
    }
    for place in 0..state.chosen.len() {
        let change = Move {
            without: without.clone(),
            with: vec![place],
            strength,
        };
        if !state.chosen[place] && state.take_if_better(&change) {
            return;
        }
    }
}
