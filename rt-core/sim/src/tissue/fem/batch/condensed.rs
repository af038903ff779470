//! Bodies in layers: the answers to what these do to the surface, and the layers' own forces.

use super::level::{BatchModel, NO_NODE};
use super::solve::BatchState;
use super::support::Support;
use super::{LOADS, NodeWeight, on_two_threads};
use crate::tissue::fem::model::FemModel;
use crate::tissue::fem::reaction::Reaction;
use crate::tissue::fem::real::Real;
use nalgebra::DMatrix;

/// Residual over load of the answers to the layers' forces.
const TOLERANCE: f64 = 2e-3;
pub(super) const MOST_ITERATIONS: u32 = 60;

/// Makes the body of a model with the layers around it.
pub(in crate::tissue::fem) fn condensed<T: Real>(model: &FemModel<T>) -> BatchModel<T> {
    let mut batch = BatchModel::of_model(model);
    if model.reactions.is_empty() {
        return batch;
    }
    let support = |reaction| support_of(&batch, reaction);
    batch.supports = model.reactions.iter().map(support).collect();
    batch
}

fn support_of<T: Real>(batch: &BatchModel<T>, reaction: &Reaction) -> Support<T> {
    let nodes: Vec<u32> = reaction
        .nodes
        .iter()
        .map(|&node| batch.levels[0].node_at.get(node as usize).copied().unwrap_or(NO_NODE))
        .collect();
    let eights: Vec<&[Vec<[f64; 3]>]> = reaction.forces.chunks(LOADS).collect();
    let answers = on_two_threads(&eights, |eights| {
        let mut state = BatchState::new(batch);
        let mut answers: Vec<Vec<[T; 3]>> = Vec::new();
        for eight in eights {
            let loads: Vec<Vec<NodeWeight>> = eight.iter().map(|forces| load(&nodes, forces)).collect();
            let loads: Vec<&[NodeWeight]> = loads.iter().map(Vec::as_slice).collect();
            state.begin(batch, &loads);
            state.solve(batch, TOLERANCE, MOST_ITERATIONS);
            let lane = |n: usize| state.u.iter().map(|u| [0, 1, 2].map(|c| u[c].0[n])).collect();
            answers.extend((0..eight.len()).map(lane));
        }
        answers
    });
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
