//! One pass over a level: the forces of all elements on the nodes, plane by plane, and the operation on them.
//!
//! A plane of nodes is handed on as soon as both planes of elements next to it are done. So forces need memory for two
//! planes only, and what follows (a smoothing step, a residual, a dot product) finds them in the cache.

use std::ops::Range;

use super::hexahedron::{CHUNK, Scratch, add_line, forces};
use super::lanes::{LANES, add_products};
use super::level::Level;
use super::real::Real;
use crate::simd::{Simd, vectorised};

/// One value for each node along x, y, z.
pub(super) type Field<T> = [Vec<T>; 3];

/// Operation on the forces of a line of nodes.
pub(super) trait LineOp<T> {
    /// Processes a line: `forces` are those of elements and springs for `x`, on the nodes `at`; no later line needs
    /// this `x`.
    fn line(&mut self, at: Range<usize>, forces: [&[T]; 3], x: [&mut [T]; 3]);
}

/// Forces on two planes of nodes, and of one row of elements.
#[derive(Clone, Debug)]
pub(super) struct Planes<T> {
    even: Field<T>,
    odd: Field<T>,
    scratch: Box<Scratch<T>>,
}

impl<T: Real> Planes<T> {
    /// Makes room for planes of so many nodes.
    pub fn new(nodes: usize) -> Self {
        Planes {
            even: zeros(nodes),
            odd: zeros(nodes),
            scratch: Box::new([[T::ZERO; CHUNK + LANES]; 24]),
        }
    }
}

/// Makes a zero for each node, in pages that have been written, so that no later write is the first; and a few more, as
/// rows of elements are done in whole lanes.
pub(super) fn zeros<T: Real>(nodes: usize) -> Field<T> {
    std::array::from_fn(|_| touched(nodes + LANES + 1, T::ZERO))
}

/// Makes copies of a value in pages that have been written.
pub(super) fn touched<V: Copy>(count: usize, value: V) -> Vec<V> {
    (0..count).map(|_| std::hint::black_box(value)).collect()
}

/// Sweeps the planes of nodes `planes` and calls `op` with each line of nodes in use.
pub(super) fn sweep<T: Real, O: LineOp<T>>(
    level: &Level<T>,
    x: &mut Field<T>,
    work: &mut Planes<T>,
    planes: Range<usize>,
    op: &mut O,
) {
    sweep_planes(level.simd, level, x, work, planes, op);
}

vectorised! {
    fn sweep_planes<T, O: LineOp>(
        level: &Level<T>,
        x: &mut Field<T>,
        work: &mut Planes<T>,
        planes: Range<usize>,
        op: &mut O,
    ) {
    let Planes { even, odd, scratch } = work;
    let (mut here, mut above) = (even, odd);
    clear(level, here);
    if planes.start > 0 {
        clear(level, above);
        add_plane(level, x, planes.start - 1, above, here, scratch);
    }
    for k in planes {
        clear(level, above);
        if k + 1 < level.grid.nodes[2] {
            add_plane(level, x, k, here, above, scratch);
        }
        finish_plane(level, x, k, here, op);
        std::mem::swap(&mut here, &mut above);
    }
}
}

#[inline(always)]
fn clear<T: Real>(level: &Level<T>, plane: &mut Field<T>) {
    let used = level.grid.stride * level.grid.nodes[1] + 1;
    plane.iter_mut().for_each(|c| c[..used].fill(T::ZERO));
}

/// Adds the forces of the elements between planes `k` and `k + 1` of nodes.
#[inline(always)]
fn add_plane<T: Real>(
    level: &Level<T>,
    x: &Field<T>,
    k: usize,
    below: &mut Field<T>,
    above: &mut Field<T>,
    scratch: &mut Scratch<T>,
) {
    let (nx, ny) = (level.grid.stride, level.grid.nodes[1]);
    for j in 0..ny - 1 {
        let [first, end] = level.grid.cell_rows[j + ny * k];
        for start in (first as usize..end as usize).step_by(CHUNK) {
            let lanes = (end as usize - start).min(CHUNK) / LANES;
            let low = start + nx * (j + ny * k);
            let (high, width) = (low + nx * ny, lanes * LANES + 1);
            let line = |c: usize, at: usize| &x[c][at..at + width];
            let four = |c: usize| [line(c, low), line(c, low + nx), line(c, high), line(c, high + nx)];
            let [mean, varying, shear] = &level.stiffness;
            let stiffness = [&mean[low..], &varying[low..], &shear[low..]];
            forces([four(0), four(1), four(2)], stiffness, lanes, scratch);
            let at = start + nx * j;
            for c in 0..3 {
                let rows = |row: usize| (&scratch[row], &scratch[12 + row]);
                let add = |(even, odd), plane: &mut [T]| add_line(even, odd, lanes, plane);
                add(rows(4 * c), &mut below[c][at..at + width]);
                add(rows(4 * c + 1), &mut below[c][at + nx..at + nx + width]);
                add(rows(4 * c + 2), &mut above[c][at..at + width]);
                add(rows(4 * c + 3), &mut above[c][at + nx..at + nx + width]);
            }
        }
    }
}

/// Adds the springs of plane `k` and hands its lines on.
#[inline(always)]
fn finish_plane<T: Real, O: LineOp<T>>(level: &Level<T>, x: &mut Field<T>, k: usize, plane: &mut Field<T>, op: &mut O) {
    let (nx, ny) = (level.grid.stride, level.grid.nodes[1]);
    for j in 0..ny {
        let [first, end] = level.grid.node_rows[j + ny * k];
        if first == end {
            continue;
        }
        let in_plane = first as usize + nx * j..end as usize + nx * j;
        let at = in_plane.start + nx * ny * k..in_plane.end + nx * ny * k;
        let springs = &level.springs[at.clone()];
        for c in 0..3 {
            add_products(springs, &x[c][at.clone()], &mut plane[c][in_plane.clone()]);
        }
        let forces = {
            let [a, b, c] = &*plane;
            [&a[in_plane.clone()], &b[in_plane.clone()], &c[in_plane]]
        };
        let [a, b, c] = &mut *x;
        let x = [&mut a[at.clone()], &mut b[at.clone()], &mut c[at.clone()]];
        op.line(at, forces, x);
    }
}
