//! Forces of all elements for eight loads at once, plane by plane, and the operations on them.
//!
//! The element is that of `hexahedron`: sums and differences of its corners, in which its stiffness falls into small
//! blocks. Neighbours along x share a face, so each face is read, and each force written, once; what two elements do to
//! the face between them is added up before it is turned back into forces on corners.

use std::ops::Range;

use super::level::{BatchLevel, Run};
use super::{LOADS, Node};
use crate::simd::{Eight, Vector, in_vectors};
use crate::tissue::fem::hexahedron::{Face, across, corners, element, factors};
use crate::tissue::fem::real::Real;

/// Operation on the forces of a plane of nodes; no later plane needs this `x`.
pub(super) trait PlaneOp<T: Real> {
    /// Processes a plane. The answer of each node is that of its elements, `forces`, and of its spring: [`answer`].
    fn plane<V: Vector<T>>(&mut self, at: Range<usize>, forces: &[Node<T>], springs: &[T], x: &mut [Node<T>]);
}

/// Returns zeros for a node.
pub(super) fn nothing<T: Real>() -> Node<T> {
    [Eight([T::ZERO; LOADS]); 3]
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
        TwoPlanes(std::array::from_fn(|_| vec![nothing(); largest]))
    }
}

/// Returns `A x`, for where it is needed once.
pub(super) fn product<T: Real>(level: &BatchLevel<T>, x: &mut [Node<T>]) -> Vec<Node<T>> {
    struct Keep<'a, T>(&'a mut [Node<T>]);
    impl<T: Real> PlaneOp<T> for Keep<'_, T> {
        #[inline(always)]
        fn plane<V: Vector<T>>(&mut self, at: Range<usize>, forces: &[Node<T>], springs: &[T], x: &mut [Node<T>]) {
            for (((kept, forces), &spring), x) in self.0[at].iter_mut().zip(forces).zip(springs).zip(x) {
                for c in 0..3 {
                    answer::<T, V>(&forces[c], spring, V::load(&x[c])).store(&mut kept[c]);
                }
            }
        }
    }
    let mut forces = vec![nothing(); x.len()];
    sweep(level.simd, level, x, &mut TwoPlanes::new(level), &mut Keep(&mut forces));
    forces
}

in_vectors! {
/// Calls `op` with each plane of nodes and the forces that elements answer to `x` with.
fn sweep<T: Real, V, O: PlaneOp>(level: &BatchLevel<T>, x: &mut [Node<T>], work: &mut TwoPlanes<T>, op: &mut O) {
    let [here, above] = &mut work.0;
    let (mut here, mut above) = (here, above);
    let size = |k: usize| level.planes.get(k + 1).map_or(0, |next| next.first_node - level.planes[k].first_node) as usize;
    here[..size(0)].fill(nothing());
    for k in 0..level.planes.len() - 1 {
        let [this, next] = [level.planes[k], level.planes[k + 1]];
        let beyond = size(k + 1);
        above[..beyond].fill(nothing());
        let at = this.first_node as usize..next.first_node as usize;
        for run in &level.runs[this.first_run as usize..next.first_run as usize] {
            add_run::<T, V>(level, run, x, [at.start, at.end], &mut here[..at.len()], &mut above[..beyond]);
        }
        op.plane::<V>(at.clone(), &here[..at.len()], &level.springs[at.clone()], &mut x[at]);
        std::mem::swap(&mut here, &mut above);
    }
}
}

/// Returns the force of elements and spring for a displacement.
#[inline(always)]
pub(super) fn answer<T: Real, V: Vector<T>>(forces: &Eight<T>, spring: T, x: V) -> V {
    V::load(forces).add(V::splat(spring).mul(x))
}

#[inline(always)]
fn face<T: Real, V: Vector<T>>(lines: &[&[Node<T>]; 4], e: usize) -> Face<V> {
    let [a, b, c, d] = [&lines[0][e], &lines[1][e], &lines[2][e], &lines[3][e]];
    let component = |n: usize| across([V::load(&a[n]), V::load(&b[n]), V::load(&c[n]), V::load(&d[n])]);
    [component(0), component(1), component(2)]
}

/// Adds the forces of the elements of a run. `nodes` are the first node of the plane and of the next.
#[inline(always)]
fn add_run<T: Real, V: Vector<T>>(
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
    let [a, b] = two_lines(here, [a - nodes[0], b - nodes[0]], len + 1);
    let [c, d] = two_lines(above, [c - nodes[1], d - nodes[1]], len + 1);
    let mut near = face::<T, V>(&lines, 0);
    // What the element before does to the face, in sums and differences of it.
    let mut carried = [[V::splat(T::ZERO); 4]; 3];
    for (e, &stiffness) in stiffness.iter().enumerate() {
        let far = face::<T, V>(&lines, e + 1);
        let (even, odd) = element::<V, false>(&near, &far, factors(stiffness).map(V::splat));
        for component in 0..3 {
            let [before, even, odd] = [carried[component], even[component], odd[component]];
            let forces = corners([
                before[0] - odd[0],
                before[1] + (even[1] - odd[1]),
                before[2] + (even[2] - odd[2]),
                before[3] + (even[3] - odd[3]),
            ]);
            carried[component] = [odd[0], even[1] + odd[1], even[2] + odd[2], even[3] + odd[3]];
            add_to::<T, V>(&mut a[e][component], forces[0]);
            add_to::<T, V>(&mut b[e][component], forces[1]);
            add_to::<T, V>(&mut c[e][component], forces[2]);
            add_to::<T, V>(&mut d[e][component], forces[3]);
        }
        near = far;
    }
    for (component, carried) in carried.into_iter().enumerate() {
        let forces = corners(carried);
        add_to::<T, V>(&mut a[len][component], forces[0]);
        add_to::<T, V>(&mut b[len][component], forces[1]);
        add_to::<T, V>(&mut c[len][component], forces[2]);
        add_to::<T, V>(&mut d[len][component], forces[3]);
    }
}

/// Returns two lines of a plane, the lower one first.
#[inline(always)]
fn two_lines<N>(plane: &mut [N], at: [usize; 2], len: usize) -> [&mut [N]; 2] {
    let (low, high) = plane.split_at_mut(at[1]);
    [&mut low[at[0]..at[0] + len], &mut high[..len]]
}

#[inline(always)]
fn add_to<T: Real, V: Vector<T>>(to: &mut Eight<T>, more: V) {
    V::load(to).add(more).store(to);
}
