//! The forces of all elements for eight loads at once, plane by plane, and what is done with them.
//!
//! The element is that of `hexahedron`: sums and differences of its corners, in which its stiffness falls into small blocks.
//! Neighbours along x share a face, so each face is read, and each force written, once.

use std::ops::Range;

use super::level::{BatchLevel, Run};
use super::{LOADS, Lanes, Node};
use crate::simd::{Simd, vectorised};
use crate::tissue::fem::real::Real;

/// What to do with the forces on a plane of nodes; no later plane needs this `x`.
pub(super) trait PlaneOp<T> {
    fn plane(&mut self, at: Range<usize>, forces: &[Node<T>], x: &mut [Node<T>]);
}

/// Forces on two planes of nodes.
#[derive(Clone, Debug)]
pub(super) struct TwoPlanes<T>(pub [Vec<Node<T>>; 2]);

impl<T: Real> TwoPlanes<T> {
    pub fn new(level: &BatchLevel<T>) -> Self {
        let sizes = level
            .planes
            .windows(2)
            .map(|p| (p[1].first_node - p[0].first_node) as usize);
        let largest = sizes.max().unwrap_or(0);
        TwoPlanes(std::array::from_fn(|_| vec![[[T::ZERO; LOADS]; 3]; largest]))
    }
}

/// `A x`, for where it is needed once.
pub(super) fn product<T: Real>(level: &BatchLevel<T>, x: &mut [Node<T>]) -> Vec<Node<T>> {
    struct Keep<'a, T>(&'a mut [Node<T>]);
    impl<T: Real> PlaneOp<T> for Keep<'_, T> {
        #[inline(always)]
        fn plane(&mut self, at: Range<usize>, forces: &[Node<T>], _: &mut [Node<T>]) {
            self.0[at].copy_from_slice(forces);
        }
    }
    let mut forces = vec![[[T::ZERO; LOADS]; 3]; x.len()];
    sweep(level.simd, level, x, &mut TwoPlanes::new(level), &mut Keep(&mut forces));
    forces
}

vectorised! {
/// Calls `op` with each plane of nodes and the forces that elements and springs answer to `x` with.
fn sweep<T, O: PlaneOp>(level: &BatchLevel<T>, x: &mut [Node<T>], work: &mut TwoPlanes<T>, op: &mut O) {
    let [here, above] = &mut work.0;
    let (mut here, mut above) = (here, above);
    let size = |k: usize| level.planes.get(k + 1).map_or(0, |next| next.first_node - level.planes[k].first_node) as usize;
    here[..size(0)].fill([[T::ZERO; LOADS]; 3]);
    for k in 0..level.planes.len() - 1 {
        let [this, next] = [level.planes[k], level.planes[k + 1]];
        let beyond = size(k + 1);
        above[..beyond].fill([[T::ZERO; LOADS]; 3]);
        let at = this.first_node as usize..next.first_node as usize;
        for run in &level.runs[this.first_run as usize..next.first_run as usize] {
            add_run(level, run, x, [at.start, at.end], &mut here[..at.len()], &mut above[..beyond]);
        }
        let forces = &mut here[..at.len()];
        for ((force, x), &spring) in forces.iter_mut().zip(&x[at.clone()]).zip(&level.springs[at.clone()]) {
            for (force, x) in force.iter_mut().zip(x) {
                let (f, x) = (*force, *x);
                *force = each(|n| f[n] + spring * x[n]);
            }
        }
        op.plane(at.clone(), forces, &mut x[at]);
        std::mem::swap(&mut here, &mut above);
    }
}
}

/// Lanes from their entries.
#[inline(always)]
pub(super) fn each<T: Real>(f: impl Fn(usize) -> T) -> Lanes<T> {
    let mut lanes = [T::ZERO; LOADS];
    for (n, value) in lanes.iter_mut().enumerate() {
        *value = f(n);
    }
    lanes
}

#[inline(always)]
fn add<T: Real>(a: Lanes<T>, b: Lanes<T>) -> Lanes<T> {
    each(|n| a[n] + b[n])
}

#[inline(always)]
fn sub<T: Real>(a: Lanes<T>, b: Lanes<T>) -> Lanes<T> {
    each(|n| a[n] - b[n])
}

#[inline(always)]
fn mul<T: Real>(a: T, b: Lanes<T>) -> Lanes<T> {
    each(|n| a * b[n])
}

/// Sums and differences of four corners of a face: 1, y, z, yz.
#[inline(always)]
fn across<T: Real>([a, b, c, d]: [Lanes<T>; 4]) -> [Lanes<T>; 4] {
    let (low, high) = (add(a, b), add(c, d));
    let (low_y, high_y) = (sub(b, a), sub(d, c));
    [add(low, high), add(low_y, high_y), sub(high, low), sub(high_y, low_y)]
}

/// The transpose of `across`.
#[inline(always)]
fn corners<T: Real>([one, y, z, yz]: [Lanes<T>; 4]) -> [Lanes<T>; 4] {
    let (low, high) = (sub(one, z), add(one, z));
    let (low_y, high_y) = (sub(y, yz), add(y, yz));
    [sub(low, low_y), add(low, low_y), sub(high, high_y), add(high, high_y)]
}

/// 1, y, z, yz of x, y, z on one face.
type Face<T> = [[Lanes<T>; 4]; 3];

#[inline(always)]
fn face<T: Real>(lines: &[&[Node<T>]; 4], e: usize) -> Face<T> {
    let [a, b, c, d] = [&lines[0][e], &lines[1][e], &lines[2][e], &lines[3][e]];
    [
        across([a[0], b[0], c[0], d[0]]),
        across([a[1], b[1], c[1], d[1]]),
        across([a[2], b[2], c[2], d[2]]),
    ]
}

/// Adds the forces of the elements of a run. `nodes` are the first node of the plane and of the next.
#[inline(always)]
fn add_run<T: Real>(
    level: &BatchLevel<T>,
    run: &Run,
    x: &[Node<T>],
    nodes: [usize; 2],
    here: &mut [Node<T>],
    above: &mut [Node<T>],
) {
    let len = run.len as usize;
    let line = |at: u32| &x[at as usize..at as usize + len + 1];
    let lines = run.lines.map(line);
    let first = run.first_element as usize;
    let stiffness = &level.stiffness[first..first + len];
    let [a, b, c, d] = run.lines.map(|at| at as usize);
    let [a, b, c, d] = [a - nodes[0], b - nodes[0], c - nodes[1], d - nodes[1]];
    let mut near = face(&lines, 0);
    let zero = [[T::ZERO; LOADS]; 4];
    let mut carried = [zero; 3];
    for (e, &stiffness) in stiffness.iter().enumerate() {
        let far = face(&lines, e + 1);
        let (even, odd) = element(&near, &far, stiffness);
        for component in 0..3 {
            let (even, odd) = (corners(even[component]), corners(odd[component]));
            let out = |at: &mut Lanes<T>, corner: usize, carried: &Lanes<T>| {
                let (before, e, o) = (*at, even[corner], odd[corner]);
                *at = each(|n| before[n] + (carried[n] + (e[n] - o[n])));
            };
            out(&mut here[a + e][component], 0, &carried[component][0]);
            out(&mut here[b + e][component], 1, &carried[component][1]);
            out(&mut above[c + e][component], 2, &carried[component][2]);
            out(&mut above[d + e][component], 3, &carried[component][3]);
            for corner in 0..4 {
                carried[component][corner] = add(even[corner], odd[corner]);
            }
        }
        near = far;
    }
    for component in 0..3 {
        let out = |at: &mut Lanes<T>, corner: usize| *at = add(*at, carried[component][corner]);
        out(&mut here[a + len][component], 0);
        out(&mut here[b + len][component], 1);
        out(&mut above[c + len][component], 2);
        out(&mut above[d + len][component], 3);
    }
}

/// Parts of the forces even and odd in x, as `hexahedron::forces` has them.
#[inline(always)]
fn element<T: Real>(near: &Face<T>, far: &Face<T>, [mean, varying, shear]: [T; 3]) -> (Face<T>, Face<T>) {
    let even = |c: usize, m: usize| add(near[c][m], far[c][m]);
    let odd = |c: usize, m: usize| sub(far[c][m], near[c][m]);
    let third = T::of(1.0 / 3.0);
    let (m0, l0, l1) = (shear, mean, varying);
    let m1 = m0 * third;
    let (u1, v2, w3) = (odd(0, 0), even(1, 1), even(2, 2));
    let dilatation = mul(l0, add(u1, add(v2, w3)));
    let normal = T::of(2.0) * m0;
    let xy = mul(m0, add(even(0, 1), odd(1, 0)));
    let xz = mul(m0, add(even(0, 2), odd(2, 0)));
    let yz = mul(m0, add(even(1, 2), even(2, 1)));
    let (vx, wx) = (odd(1, 1), odd(2, 2));
    let (uy, wy) = (odd(0, 1), even(2, 3));
    let (uz, vz) = (odd(0, 2), even(1, 3));
    let along_x = mul(l1, add(vx, wx));
    let along_y = mul(l1, add(uy, wy));
    let along_z = mul(l1, add(uz, vz));
    let (ut, vt, wt) = (even(0, 3), odd(1, 2), odd(2, 1));
    let twist = add(ut, add(vt, wt));
    let last = (l1 + m1 + m1 + m1 + m1) * third;
    let zero = [T::ZERO; LOADS];
    let plus = |a: Lanes<T>, s: T, b: Lanes<T>| each(|n| a[n] + s * b[n]);
    let twisted = |a: Lanes<T>| mul(m1, add(a, twist));
    (
        [
            [zero, xy, xz, twisted(ut)],
            [zero, plus(dilatation, normal, v2), yz, plus(along_z, m0, vz)],
            [zero, yz, plus(dilatation, normal, w3), plus(along_y, m0, wy)],
        ],
        [
            [
                plus(dilatation, normal, u1),
                plus(along_y, m0, uy),
                plus(along_z, m0, uz),
                mul(last, odd(0, 3)),
            ],
            [xy, plus(along_x, m0, vx), twisted(vt), mul(last, odd(1, 3))],
            [xz, twisted(wt), plus(along_x, m0, wx), mul(last, odd(2, 3))],
        ],
    )
}
