//! One pass over a level: the forces of all elements on the nodes, plane by plane, and what is done with them.
//!
//! A plane of nodes is handed on as soon as both planes of elements beside it are done. So forces need memory for two planes
//! only, and what follows (a smoothing step, a residual, a dot product) finds them in the cache.

use std::ops::Range;

use super::hexahedron::{CHUNK, Scratch, add_line, forces};
use super::level::Level;
use super::real::Real;

/// One value for each node along x, y, z.
pub(super) type Field<T> = [Vec<T>; 3];

/// What to do with the forces on a line of nodes.
pub(super) trait LineOp<T> {
    /// `forces` is what the elements and springs answer to `x` with, on the nodes `at`; no later line needs this `x`.
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
    /// Room for planes of so many nodes.
    pub fn new(nodes: usize) -> Self {
        Planes {
            even: zeros(nodes),
            odd: zeros(nodes),
            scratch: Box::new([[T::ZERO; CHUNK]; 24]),
        }
    }
}

/// Zeros in pages that have been written, so that no later write is the first.
pub(super) fn zeros<T: Real>(nodes: usize) -> Field<T> {
    std::array::from_fn(|_| (0..nodes).map(|_| std::hint::black_box(T::ZERO)).collect())
}

/// Vector instructions of the processor. The results are the same: nothing is reordered or fused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Simd {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Simd {
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Simd::Avx2;
        }
        Simd::Portable
    }
}

/// Sweeps the planes of nodes `planes` and calls `op` with each line of nodes in use.
pub(super) fn sweep<T: Real, O: LineOp<T>>(
    level: &Level<T>,
    x: &mut Field<T>,
    work: &mut Planes<T>,
    planes: Range<usize>,
    op: &mut O,
) {
    match level.simd {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `detect` has found AVX2.
        Simd::Avx2 => unsafe { sweep_avx2(level, x, work, planes, op) },
        Simd::Portable => sweep_lines(level, x, work, planes, op),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sweep_avx2<T: Real, O: LineOp<T>>(
    level: &Level<T>,
    x: &mut Field<T>,
    work: &mut Planes<T>,
    planes: Range<usize>,
    op: &mut O,
) {
    sweep_lines(level, x, work, planes, op);
}

#[inline(always)]
fn sweep_lines<T: Real, O: LineOp<T>>(
    level: &Level<T>,
    x: &mut Field<T>,
    work: &mut Planes<T>,
    planes: Range<usize>,
    op: &mut O,
) {
    let Planes { even, odd, scratch } = work;
    let (mut here, mut above) = (even, odd);
    clear(here);
    if planes.start > 0 {
        clear(above);
        add_plane(level, x, planes.start - 1, above, here, scratch);
    }
    for k in planes {
        clear(above);
        if k + 1 < level.grid.nodes[2] {
            add_plane(level, x, k, here, above, scratch);
        }
        finish_plane(level, x, k, here, op);
        std::mem::swap(&mut here, &mut above);
    }
}

#[inline(always)]
fn clear<T: Real>(plane: &mut Field<T>) {
    plane.iter_mut().for_each(|c| c.fill(T::ZERO));
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
    let [nx, ny, _] = level.grid.nodes;
    for j in 0..ny - 1 {
        let [first, end] = level.grid.cell_rows[j + ny * k].map(|i| i as usize);
        for start in (first..end).step_by(CHUNK) {
            let n = (end - start).min(CHUNK);
            let low = start + nx * (j + ny * k);
            let starts = [low, low + nx, low + nx * ny, low + nx * ny + nx];
            let lines = [0, 1, 2].map(|c| starts.map(|at| &x[c][at..=at + n]));
            let stiffness = [0, 1, 2].map(|c| &level.stiffness[c][low..low + n]);
            forces(lines, stiffness, scratch);
            let in_plane = start + nx * j;
            for component in 0..3 {
                for corner in 0..4 {
                    let plane = if corner < 2 { &mut *below } else { &mut *above };
                    let at = in_plane + nx * (corner & 1);
                    let row = 4 * component + corner;
                    add_line(&scratch[row], &scratch[12 + row], &mut plane[component][at..=at + n]);
                }
            }
        }
    }
}

/// Adds the springs of plane `k` and hands its lines on.
#[inline(always)]
fn finish_plane<T: Real, O: LineOp<T>>(level: &Level<T>, x: &mut Field<T>, k: usize, plane: &mut Field<T>, op: &mut O) {
    let [nx, ny, _] = level.grid.nodes;
    for j in 0..ny {
        let [first, end] = level.grid.node_rows[j + ny * k].map(|i| i as usize);
        if first == end {
            continue;
        }
        let at = first + nx * (j + ny * k)..end + nx * (j + ny * k);
        let in_plane = first + nx * j..end + nx * j;
        let springs = &level.springs[at.clone()];
        for (plane, x) in plane.iter_mut().zip(x.iter()) {
            let (force, x) = (&mut plane[in_plane.clone()], &x[at.clone()]);
            for ((force, &x), &spring) in force.iter_mut().zip(x).zip(springs) {
                *force += spring * x;
            }
        }
        let forces = plane.each_ref().map(|c| &c[in_plane.clone()]);
        let x = x.each_mut().map(|c| &mut c[at.clone()]);
        op.line(at, forces, x);
    }
}
