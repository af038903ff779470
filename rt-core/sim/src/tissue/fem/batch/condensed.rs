//! Bodies in layers: the answers to what these do to the surface, and the layers' own forces.

use super::kernel::{nothing, product};
use super::level::{BatchModel, NO_NODE};
use super::solve::BatchState;
use super::support::Support;
use super::{LOADS, Node, NodeWeight};
use crate::simd::Eight;
use crate::tissue::fem::model::FemModel;
use crate::tissue::fem::reaction::Reaction;
use crate::tissue::fem::real::Real;
use nalgebra::DMatrix;

/// Residual over load of the answers to the layers' forces.
const TOLERANCE: f64 = 2e-3;
/// The same of the layers alone, whose load is uneven: what is left of an even displacement is small beside it.
const TOLERANCE_OF_LAYERS: f64 = 3e-3;
const MOST_ITERATIONS: u32 = 60;

/// Makes the body of a model with the layers around it.
pub(in crate::tissue::fem) fn condensed<T: Real>(model: &FemModel<T>) -> BatchModel<T> {
    let mut batch = BatchModel::of_model(model);
    if model.reactions.is_empty() {
        return batch;
    }
    let mut state = BatchState::new(&batch);
    let support = |reaction| support_of(&batch, &mut state, reaction);
    batch.supports = model.reactions.iter().map(support).collect();
    batch
}

fn support_of<T: Real>(batch: &BatchModel<T>, state: &mut BatchState<T>, reaction: &Reaction) -> Support<T> {
    let nodes: Vec<u32> = reaction
        .nodes
        .iter()
        .map(|&node| batch.levels[0].node_at.get(node as usize).copied().unwrap_or(NO_NODE))
        .collect();
    let mut answers = Vec::with_capacity(reaction.forces.len());
    for eight in reaction.forces.chunks(LOADS) {
        let loads: Vec<Vec<NodeWeight>> = eight.iter().map(|forces| load(&nodes, forces)).collect();
        let loads: Vec<&[NodeWeight]> = loads.iter().map(Vec::as_slice).collect();
        state.begin(batch, &loads);
        state.solve(batch, TOLERANCE, MOST_ITERATIONS);
        let lane = |n: usize| state.u.iter().map(|u| [0, 1, 2].map(|c| u[c].0[n])).collect();
        answers.extend((0..eight.len()).map(lane));
    }
    let moved = |m: usize, n: usize| {
        let (forces, answer): (_, &Vec<[T; 3]>) = (&reaction.forces[m], &answers[n]);
        let at = |(&node, force): (&u32, &[f64; 3])| {
            let u = answer.get(node as usize)?;
            Some((0..3).map(|c| force[c] * u[c].to_f64()).sum::<f64>())
        };
        nodes.iter().zip(forces).filter_map(at).sum::<f64>()
    };
    let size = reaction.forces.len();
    let moved = DMatrix::from_fn(size, size, |m, n| 0.5 * (moved(m, n) + moved(n, m)));
    let of_both = DMatrix::identity(size, size) + &reaction.mix * moved;
    let narrow = |forces: &Vec<[f64; 3]>| forces.iter().map(|f| f.map(T::of)).collect();
    Support {
        nodes,
        forces: reaction.forces.iter().map(narrow).collect(),
        answers,
        mix: of_both.try_inverse().unwrap_or_else(|| DMatrix::zeros(size, size)) * &reaction.mix,
    }
}

fn load(nodes: &[u32], forces: &[[f64; 3]]) -> Vec<NodeWeight> {
    let entries = nodes.iter().zip(forces);
    entries.map(|(&node, &weight)| NodeWeight { node, weight }).collect()
}

/// Returns the force on each of these nodes of the finest grid, which are fixed, for each of their displacements.
pub(in crate::tissue::fem) fn held_forces_n<T: Real>(
    batch: &BatchModel<T>,
    held: &[u32],
    displacements_m: &[Vec<[f64; 3]>],
) -> Vec<Vec<[f64; 3]>> {
    let level = &batch.levels[0];
    let node = |at: u32| level.node_at.get(at as usize).copied().unwrap_or(NO_NODE) as usize;
    let mut state = BatchState::new(batch);
    let mut forces = Vec::new();
    for eight in displacements_m.chunks(LOADS) {
        let mut u: Vec<Node<T>> = vec![nothing(); batch.node_count()];
        for (lane, displacement) in eight.iter().enumerate() {
            for (&at, by_m) in held.iter().zip(displacement) {
                if let Some(u) = u.get_mut(node(at)) {
                    (0..3).for_each(|c| u[c].0[lane] = T::of(by_m[c]));
                }
            }
        }
        let pulled = product(level, &mut u);
        let of_lane = |f: &Node<T>, lane: usize| f.each_ref().map(|c: &Eight<T>| c.0[lane].to_f64());
        let loads: Vec<Vec<NodeWeight>> = (0..eight.len())
            .map(|lane| {
                let entry = |(node, f): (usize, &Node<T>)| NodeWeight {
                    node: node as u32,
                    weight: of_lane(f, lane).map(|c| -c),
                };
                let entries = pulled.iter().enumerate().map(entry);
                entries.filter(|entry| entry.weight != [0.0; 3]).collect()
            })
            .collect();
        let loads: Vec<&[NodeWeight]> = loads.iter().map(Vec::as_slice).collect();
        state.begin(batch, &loads);
        state.solve(batch, TOLERANCE_OF_LAYERS, MOST_ITERATIONS);
        for (u, more) in u.iter_mut().zip(&state.u) {
            for (u, more) in u.iter_mut().zip(more) {
                (0..LOADS).for_each(|lane| u.0[lane] += more.0[lane]);
            }
        }
        let answered = product(level, &mut u);
        let at = |&at: &u32, lane: usize| answered.get(node(at)).map_or([0.0; 3], |f| of_lane(f, lane));
        forces.extend((0..eight.len()).map(|lane| held.iter().map(|n| at(n, lane)).collect()));
    }
    forces
}
