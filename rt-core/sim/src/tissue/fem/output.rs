//! Displacements of the element centres from responses of the nodes: everything else reads these.

use super::hexahedron::CHUNK;
use super::model::{CellRun, FemModel};
use super::real::Real;
use super::state::FemState;
use crate::simd::{Simd, vectorised};

/// Superposes the responses and writes the displacements; returns how many elements moved.
pub(super) fn write<T: Real>(model: &FemModel<T>, state: &mut FemState<T>) -> u32 {
    let (mut moved, mut largest) = (0, 0.0_f32);
    for run in &model.runs {
        for start in (0..run.len).step_by(CHUNK) {
            let piece = CellRun {
                first: run.first + start,
                len: (run.len - start).min(CHUNK),
                cell: run.cell + start,
            };
            let (count, square) = write_piece(model.levels[0].simd, model, state, &piece);
            moved += count;
            largest = largest.max(square);
            if square.is_nan() {
                largest = f32::INFINITY;
            }
        }
    }
    state.max_displacement = largest.sqrt();
    moved
}

vectorised! {
/// Writes the displacement of centres: the mean of the eight corners. Returns elements moved and the largest square.
fn write_piece<T>(model: &FemModel<T>, state: &mut FemState<T>, piece: &CellRun) -> (u32, f32) {
    let n = piece.len;
    let grid = &model.levels[0].grid;
    let (nx, ny) = (grid.stride, grid.nodes[1]);
    let rows = [0, nx, nx * ny, nx * ny + nx].map(|step| piece.cell + step);
    let mut now = [[0.0_f32; CHUNK]; 3];
    let mut same = [true; CHUNK];
    for (component, now) in now.iter_mut().enumerate() {
        let mut sums = [T::ZERO; CHUNK];
        for response in state.grip.used().iter().filter(|r| r.weight_m != 0.0) {
            let weight = T::of(response.weight_m / (8.0 * model.lattice.spacing_m));
            let [a, b, c, d] = rows.map(|at| &response.u[component][at..=at + n]);
            for e in 0..n {
                let near = (a[e] + b[e]) + (c[e] + d[e]);
                let far = (a[e + 1] + b[e + 1]) + (c[e + 1] + d[e + 1]);
                sums[e] += weight * (near + far);
            }
        }
        let kept = &mut state.displacement[component][piece.first..piece.first + n];
        for e in 0..n {
            now[e] = sums[e].to_f64() as f32;
            same[e] &= now[e] == kept[e];
        }
        kept.copy_from_slice(&now[..n]);
    }
    let squares = (0..n).map(|e| now[0][e] * now[0][e] + now[1][e] * now[1][e] + now[2][e] * now[2][e]);
    // A NaN must not lose against a number.
    let largest = squares.fold(
        0.0,
        |largest: f32, square| if square <= largest { largest } else { square },
    );
    let moved = same[..n].iter().filter(|&&same| !same).count();
    (moved as u32, largest)
}
}
