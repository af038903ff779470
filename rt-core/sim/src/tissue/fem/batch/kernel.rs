//! Forces of all elements for eight loads at once, plane by plane, and the operations on them.
//!
//! The element is that of `hexahedron`: sums and differences of its corners, in which its stiffness falls into small
//! blocks. Neighbours along x share a face, so each face is read, and each force written, once; what two elements do to
//! the face between them is added up before it is turned back into forces on corners.

use std::ops::Range;

use super::level::{BatchLevel, Run};
use super::{LOADS, Node};
use crate::simd::{Eight, Vector, in_vectors};
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

/// Returns sums and differences of four corners of a face: 1, y, z, yz.
#[inline(always)]
fn across<T: Real, V: Vector<T>>([a, b, c, d]: [V; 4]) -> [V; 4] {
    let (low, high) = (a.add(b), c.add(d));
    let (low_y, high_y) = (b.sub(a), d.sub(c));
    [low.add(high), low_y.add(high_y), high.sub(low), high_y.sub(low_y)]
}

/// Applies the transpose of `across`.
#[inline(always)]
fn corners<T: Real, V: Vector<T>>([one, y, z, yz]: [V; 4]) -> [V; 4] {
    let (low, high) = (one.sub(z), one.add(z));
    let (low_y, high_y) = (y.sub(yz), y.add(yz));
    [low.sub(low_y), low.add(low_y), high.sub(high_y), high.add(high_y)]
}

/// 1, y, z, yz of x, y, z on one face.
type Face<V> = [[V; 4]; 3];

#[inline(always)]
fn face<T: Real, V: Vector<T>>(lines: &[&[Node<T>]; 4], e: usize) -> Face<V> {
    let [a, b, c, d] = [&lines[0][e], &lines[1][e], &lines[2][e], &lines[3][e]];
    let component = |n: usize| across::<T, V>([V::load(&a[n]), V::load(&b[n]), V::load(&c[n]), V::load(&d[n])]);
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
        let (even, odd) = element::<T, V>(&near, &far, stiffness);
        for component in 0..3 {
            let [before, even, odd] = [carried[component], even[component], odd[component]];
            let forces = corners::<T, V>([
                before[0].sub(odd[0]),
                before[1].add(even[1].sub(odd[1])),
                before[2].add(even[2].sub(odd[2])),
                before[3].add(even[3].sub(odd[3])),
            ]);
            carried[component] = [odd[0], even[1].add(odd[1]), even[2].add(odd[2]), even[3].add(odd[3])];
            add_to::<T, V>(&mut a[e][component], forces[0]);
            add_to::<T, V>(&mut b[e][component], forces[1]);
            add_to::<T, V>(&mut c[e][component], forces[2]);
            add_to::<T, V>(&mut d[e][component], forces[3]);
        }
        near = far;
    }
    for (component, carried) in carried.into_iter().enumerate() {
        let forces = corners::<T, V>(carried);
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

/// Parts of the forces even and odd in x, as `hexahedron::forces` has them; those even in x and constant on the face
/// are zero.
#[inline(always)]
fn element<T: Real, V: Vector<T>>(near: &Face<V>, far: &Face<V>, [mean, varying, shear]: [T; 3]) -> (Face<V>, Face<V>) {
    let even = |c: usize, m: usize| near[c][m].add(far[c][m]);
    let odd = |c: usize, m: usize| far[c][m].sub(near[c][m]);
    let third = T::of(1.0 / 3.0);
    let thirds = shear * third;
    let (m0, m1, l0, l1) = (V::splat(shear), V::splat(thirds), V::splat(mean), V::splat(varying));
    let (u1, v2, w3) = (odd(0, 0), even(1, 1), even(2, 2));
    let dilatation = l0.mul(u1.add(v2.add(w3)));
    let normal = V::splat(T::of(2.0) * shear);
    let xy = m0.mul(even(0, 1).add(odd(1, 0)));
    let xz = m0.mul(even(0, 2).add(odd(2, 0)));
    let yz = m0.mul(even(1, 2).add(even(2, 1)));
    let (vx, wx) = (odd(1, 1), odd(2, 2));
    let (uy, wy) = (odd(0, 1), even(2, 3));
    let (uz, vz) = (odd(0, 2), even(1, 3));
    let along_x = l1.mul(vx.add(wx));
    let along_y = l1.mul(uy.add(wy));
    let along_z = l1.mul(uz.add(vz));
    let (ut, vt, wt) = (even(0, 3), odd(1, 2), odd(2, 1));
    let twist = ut.add(vt.add(wt));
    let last = V::splat((varying + thirds + thirds + thirds + thirds) * third);
    let zero = V::splat(T::ZERO);
    let plus = |a: V, s: V, b: V| a.add(s.mul(b));
    let twisted = |a: V| m1.mul(a.add(twist));
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
                last.mul(odd(0, 3)),
            ],
            [xy, plus(along_x, m0, vx), twisted(vt), last.mul(odd(1, 3))],
            [xz, twisted(wt), plus(along_x, m0, wx), last.mul(odd(2, 3))],
        ],
    )
}
