//! Forces that hold nodes of a body at given displacements.

use super::condensed::MOST_ITERATIONS;
use super::kernel::{nothing, product};
use super::level::{BatchModel, NO_NODE};
use super::solve::{BatchState, SUMMED, add_up};
use super::{LOADS, Node, NodeWeight, on_two_threads};
use crate::simd::{Eight, in_vectors};
use crate::tissue::fem::real::Real;
use nalgebra::DMatrix;

/// Residual over load: the load is uneven, and what is left of an even displacement is small beside it.
const TOLERANCE: f64 = 1.5e-2;

/// Forces on the same nodes for a list of displacements.
pub(in crate::tissue::fem) struct HeldForces {
    /// Force on each node for each displacement.
    pub forces_n: Vec<Vec<[f64; 3]>>,
    /// Work of the forces for each displacement along each other one. Its error is of second order in that of the
    /// displacements, the forces' is of first.
    pub work_j: DMatrix<f64>,
}

/// Returns the forces on these nodes of the finest grid, which are fixed, for each of their displacements.
pub(in crate::tissue::fem) fn held_forces<T: Real>(
    batch: &BatchModel<T>,
    held: &[u32],
    displacements_m: &[Vec<[f64; 3]>],
) -> HeldForces {
    let level = &batch.levels[0];
    let node = |at: &u32| level.node_at.get(*at as usize).copied().unwrap_or(NO_NODE) as usize;
    let held: Vec<usize> = held.iter().map(node).collect();
    let eights: Vec<&[Vec<[f64; 3]>]> = displacements_m.chunks(LOADS).collect();
    let mut solved = on_two_threads(&eights, |eights| {
        let mut state = BatchState::new(batch);
        eights
            .iter()
            .map(|eight| follow(batch, &mut state, &held, eight))
            .collect()
    });
    let count = displacements_m.len();
    let mut forces_n = Vec::with_capacity(count);
    let mut work_j = DMatrix::zeros(count, count);
    for later in 0..solved.len() {
        let answered = product(level, &mut solved[later]);
        let first = later * LOADS;
        for lane in 0..LOADS.min(count - first) {
            let at = |&node: &usize| answered.get(node).map_or([0.0; 3], |force| of_lane(force, lane));
            forces_n.push(held.iter().map(at).collect());
        }
        for (earlier, u) in solved[..=later].iter().enumerate() {
            let works_j = works_j(level.simd, u, &answered);
            for (m, n) in (0..LOADS * LOADS).map(|at| (at / LOADS, at % LOADS)) {
                let (row, column) = (earlier * LOADS + m, first + n);
                if row.max(column) < count {
                    work_j[(row, column)] = works_j[m][n];
                    work_j[(column, row)] = works_j[m][n];
                }
            }
        }
    }
    HeldForces { forces_n, work_j }
}

/// Returns the displacement of all nodes for each of at most eight of the held ones.
fn follow<T: Real>(
    batch: &BatchModel<T>,
    state: &mut BatchState<T>,
    held: &[usize],
    eight: &[Vec<[f64; 3]>],
) -> Vec<Node<T>> {
    let mut u: Vec<Node<T>> = vec![nothing(); batch.node_count()];
    for (lane, displacement) in eight.iter().enumerate() {
        for (&node, by_m) in held.iter().zip(displacement) {
            if let Some(u) = u.get_mut(node) {
                (0..3).for_each(|c| u[c].0[lane] = T::of(by_m[c]));
            }
        }
    }
    let pulled = product(&batch.levels[0], &mut u);
    let load = |lane: usize| -> Vec<NodeWeight> {
        let entry = |(node, force): (usize, &Node<T>)| NodeWeight {
            node: node as u32,
            weight: of_lane(force, lane).map(|c| -c),
        };
        let entries = pulled.iter().enumerate().map(entry);
        entries.filter(|entry| entry.weight != [0.0; 3]).collect()
    };
    let loads: Vec<Vec<NodeWeight>> = (0..eight.len()).map(load).collect();
    let loads: Vec<&[NodeWeight]> = loads.iter().map(Vec::as_slice).collect();
    state.begin(batch, &loads);
    state.solve(batch, TOLERANCE, MOST_ITERATIONS);
    for (u, more) in u.iter_mut().flatten().zip(state.u.iter().flatten()) {
        (0..LOADS).for_each(|lane| u.0[lane] += more.0[lane]);
    }
    u
}

fn of_lane<T: Real>(force: &Node<T>, lane: usize) -> [f64; 3] {
    force.each_ref().map(|c: &Eight<T>| c.0[lane].to_f64())
}

in_vectors! {
/// Returns the work of each of eight forces along each of eight displacements, the displacement first.
fn works_j<T: Real, V>(u: &[Node<T>], forces: &[Node<T>]) -> [[f64; LOADS]; LOADS] {
    let mut totals = [[0.0; LOADS]; LOADS];
    for (u, forces) in u.chunks(SUMMED).zip(forces.chunks(SUMMED)) {
        let mut sums = [V::splat(T::ZERO); LOADS];
        for (u, force) in u.iter().flatten().zip(forces.iter().flatten()) {
            let force = V::load(force);
            for (sum, &u) in sums.iter_mut().zip(&u.0) {
                *sum = sum.add(force.mul(V::splat(u)));
            }
        }
        totals.iter_mut().zip(sums).for_each(|(total, sums)| add_up(total, sums));
    }
    totals
}
}
