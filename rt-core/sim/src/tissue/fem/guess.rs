//! First guess of a patch's response, from the last patch's answer.

use super::grip::{Grip, PatchCells, Response, SAME_WAY, dot};
use super::level::Level;
use super::model::FemModel;
use super::real::Real;
use super::sweep::Field;
use crate::simd::{Simd, vectorised};

/// Largest distance of the next patch, in cells.
const NEXT_PATCH: isize = 2;

/// Guesses the next response: the displacement of `before`, per metre, moved along to the patch `cells`. Deep inside a
/// body that would be the answer.
pub(super) fn guess<T: Real>(
    model: &FemModel<T>,
    before: &Grip<T>,
    cells: PatchCells,
    by_m: [f64; 3],
    scratch: &mut Field<T>,
    to: &mut Field<T>,
) {
    let at_m = before.held_at_m();
    match before.cells.and_then(|from| moved_along(from, cells, at_m, by_m)) {
        Some(by) => {
            superpose(before.used(), 1.0 / dot(at_m, at_m).sqrt(), scratch);
            let level = &model.levels[0];
            for (to, from) in to.iter_mut().zip(scratch) {
                shifted(level.simd, level, by, from, to);
            }
        }
        None => superpose(before.used(), 1.0 / dot(by_m, by_m).sqrt(), to),
    }
}

/// Sums the displacements of responses, times `scale`.
pub(super) fn superpose<T: Real>(responses: &[Response<T>], scale: f64, to: &mut Field<T>) {
    let mut moving = responses.iter().filter(|r| r.weight_m != 0.0);
    match moving.next() {
        None => to.iter_mut().for_each(|u| u.fill(T::ZERO)),
        Some(first) => {
            let weight = T::of(first.weight_m * scale);
            for (u, v) in to.iter_mut().zip(&first.u) {
                u.iter_mut().zip(v).for_each(|(u, &v)| *u = weight * v);
            }
        }
    }
    for other in moving {
        let weight = T::of(other.weight_m * scale);
        for (u, v) in to.iter_mut().zip(&other.u) {
            u.iter_mut().zip(v).for_each(|(u, &v)| *u += weight * v);
        }
    }
}

/// Returns by how many nodes a patch has moved to the next of the same size. Nothing where they are far apart, or
/// pushed in different directions.
fn moved_along(before: PatchCells, now: PatchCells, at_m: [f64; 3], by_m: [f64; 3]) -> Option<[isize; 3]> {
    let by = [0, 1, 2].map(|a| now[a][0] as isize - before[a][0] as isize);
    let same_size = (0..3).all(|a| now[a][1] - now[a][0] == before[a][1] - before[a][0]);
    let near = by.iter().all(|n| n.abs() <= NEXT_PATCH);
    let lengths = (dot(at_m, at_m) * dot(by_m, by_m)).sqrt();
    (same_size && near && lengths > 0.0 && dot(at_m, by_m) > SAME_WAY * lengths).then_some(by)
}

vectorised! {
/// Sets `moved` at each node to `u` at the node so many nodes before it, or to its own `u` where no element touches
/// that one.
fn shifted<T>(level: &Level<T>, by: [isize; 3], u: &[T], moved: &mut [T]) {
    let (grid, in_use) = (&level.grid, &level.inverse_diagonal);
    for (row, at) in grid.node_spans().enumerate() {
        moved[at.clone()].copy_from_slice(&u[at.clone()]);
        let (j, k) = (row % grid.nodes[1], row / grid.nodes[1]);
        let inside = |n: usize, axis: usize| n.checked_add_signed(-by[axis]).filter(|&n| n < grid.nodes[axis]);
        let (Some(j), Some(k), false) = (inside(j, 1), inside(k, 2), at.is_empty()) else {
            continue;
        };
        // Past both ends of a line lie nodes that no element touches; only the first line has none before it.
        let line = grid.index([0, j, k]) + at.start % grid.stride;
        let skipped = (by[0].max(0) as usize).saturating_sub(line);
        let from = (line + skipped).saturating_add_signed(-by[0]);
        let count = (at.len() - skipped).min(in_use.len() - from);
        let to = &mut moved[at.start + skipped..][..count];
        let (u, in_use) = (&u[from..][..count], &in_use[from..][..count]);
        for ((to, &u), &in_use) in to.iter_mut().zip(u).zip(in_use) {
            *to = if in_use == T::ZERO { *to } else { u };
        }
    }
}
}
