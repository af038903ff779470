//! Energy of neo-Hookean cells between element centres, and of linear ones: the forces on the centres.
//!
//! A cell has eight corners, at each of which the three links that meet there are the columns of the deformation
//! gradient F, with J its determinant. A corner has mu / 2 (|F|² - 3) - mu ln J, a cell lambda / 2 (mean J - 1)²: so
//! the mean dilatation carries what is volumetric, as in the linear body. Below [`OPEN`] the logarithm continues as its
//! parabola: a folded cell is pushed open.

// Corners and axes are numbers that several arrays are read by.
#![allow(clippy::needless_range_loop)]

use super::grid::{Grid, ROW};
use crate::simd::{Vector, in_vectors};

/// Volume of a corner, over that at rest, below which the logarithm is a parabola.
const OPEN: f32 = 0.1;

/// Expands code for each of corners 0 to 7: which links a corner has is known when that is compiled.
macro_rules! each_corner {
    ($corner:ident $body:block) => {
        each_corner!(@ $corner $body 0 1 2 3 4 5 6 7)
    };
    (@ $corner:ident $body:block $($number:literal)*) => {
        $({
            const CORNER: usize = $number;
            let $corner = CORNER;
            $body
        })*
    };
}

/// Three numbers for each node.
pub(super) type Nodes = [Vec<f32>; 3];

/// Material of cells, by their lowest node.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// Shear moduli of corners; 0 where three links do not meet.
    pub mu: [Vec<f32>; 8],
    /// Lambda of the cell over the sum of those.
    pub lambda: Vec<f32>,
}

/// Forces on nodes, in two parts while they are added up: what a row of cells does to the nodes behind it along x lies
/// in memory where the cells do. A vector that is read across two that were just written waits for both.
#[derive(Clone, Debug)]
pub(super) struct Sides {
    /// All of it, once it is added up.
    pub sum: Nodes,
    next: Nodes,
}

impl Sides {
    pub fn new(grid: &Grid) -> Self {
        let zero = || std::array::from_fn(|_| vec![0.0; grid.len()]);
        Sides {
            sum: zero(),
            next: zero(),
        }
    }

    #[inline(always)]
    fn clear(&mut self) {
        for axis in self.sum.iter_mut().chain(&mut self.next) {
            axis.fill(0.0);
        }
    }

    #[inline(always)]
    fn join(&mut self) {
        for (sum, next) in self.sum.iter_mut().zip(&self.next) {
            for (sum, next) in sum.iter_mut().skip(1).zip(next) {
                *sum += next;
            }
        }
    }
}

in_vectors! {
/// Becomes the gradient of the energy where centres are displaced by `u` elements.
fn neo_hookean<V: Vector<f32>>(grid: &Grid, cells: &Cells, u: &Nodes, out: &mut Sides) {
    out.clear();
    let one = V::splat(1.0);
    for at in grid.rows_of_cells() {
        let mut links = links::<V>(grid, u, at);
        for axis in 0..3 {
            for link in &mut links[axis] {
                link[axis] = link[axis].add(one);
            }
        }
        let mut j = [V::splat(0.0); 8];
        let mut mean = V::splat(0.0);
        each_corner!(corner {
            let f = at_corner(&links, corner);
            j[corner] = dot(f[0], cross(f[1], f[2]));
            mean = mean.add(load::<V>(&cells.mu[corner], at).mul(j[corner].sub(one)));
        });
        let mean = mean.mul(load::<V>(&cells.lambda, at));
        let mut forces = [[[V::splat(0.0); 3]; 4]; 3];
        each_corner!(corner {
            let mu = load::<V>(&cells.mu[corner], at);
            let f = at_corner(&links, corner);
            let cof = [cross(f[1], f[2]), cross(f[2], f[0]), cross(f[0], f[1])];
            let pressure = mu.mul(mean.sub(slope(j[corner])));
            for axis in 0..3 {
                let force = &mut forces[axis][beside(axis, corner)];
                for c in 0..3 {
                    force[c] = force[c].add(mu.mul(f[axis][c]).add(pressure.mul(cof[axis][c])));
                }
            }
        });
        spread(grid, &forces, out, at);
    }
    out.join();
}
}

in_vectors! {
/// Computes the linear energy that it has near rest, likewise.
fn linear<V: Vector<f32>>(grid: &Grid, cells: &Cells, u: &Nodes, out: &mut Sides) {
    out.clear();
    for at in grid.rows_of_cells() {
        let links = links::<V>(grid, u, at);
        let mut mean = V::splat(0.0);
        for corner in 0..8 {
            let f = at_corner(&links, corner);
            mean = mean.add(load::<V>(&cells.mu[corner], at).mul(f[0][0].add(f[1][1]).add(f[2][2])));
        }
        let mean = mean.mul(load::<V>(&cells.lambda, at));
        let mut forces = [[[V::splat(0.0); 3]; 4]; 3];
        for corner in 0..8 {
            let mu = load::<V>(&cells.mu[corner], at);
            let f = at_corner(&links, corner);
            for axis in 0..3 {
                let force = &mut forces[axis][beside(axis, corner)];
                for c in 0..3 {
                    force[c] = force[c].add(mu.mul(f[axis][c].add(f[c][axis])));
                }
                force[axis] = force[axis].add(mu.mul(mean));
            }
        }
        spread(grid, &forces, out, at);
    }
    out.join();
}
}

/// Returns the slope of the logarithm.
#[inline(always)]
fn slope<V: Vector<f32>>(j: V) -> V {
    let mut lanes = [0.0; ROW];
    j.store(&mut lanes);
    for j in &mut lanes {
        let inverse = 1.0 / j.max(OPEN);
        *j = inverse + inverse * inverse * (j.max(OPEN) - *j);
    }
    V::load(&lanes)
}

#[inline(always)]
fn load<V: Vector<f32>>(of: &[f32], at: usize) -> V {
    V::load(of[at..at + ROW].try_into().expect("a row"))
}

/// A link along an axis: by where it lies along the two others.
type Links<V> = [[[V; 3]; 4]; 3];

/// Returns which of an axis' links a corner has.
#[inline(always)]
fn beside(axis: usize, corner: usize) -> usize {
    let bit = |a: usize| corner >> a & 1;
    match axis {
        0 => bit(1) + 2 * bit(2),
        1 => bit(0) + 2 * bit(2),
        _ => bit(0) + 2 * bit(1),
    }
}

/// Returns the lowest node of such a link.
#[inline(always)]
fn lowest(axis: usize, beside: usize) -> usize {
    let (low, high) = (beside & 1, beside >> 1);
    match axis {
        0 => low << 1 | high << 2,
        1 => low | high << 2,
        _ => low | high << 1,
    }
}

#[inline(always)]
fn links<V: Vector<f32>>(grid: &Grid, u: &Nodes, at: usize) -> Links<V> {
    let mut links = [[[V::splat(0.0); 3]; 4]; 3];
    for c in 0..3 {
        let mut nodes = [V::splat(0.0); 8];
        for (n, node) in nodes.iter_mut().enumerate() {
            *node = load::<V>(&u[c], at + grid.step(n));
        }
        for axis in 0..3 {
            for beside in 0..4 {
                let low = lowest(axis, beside);
                links[axis][beside][c] = nodes[low | 1 << axis].sub(nodes[low]);
            }
        }
    }
    links
}

/// Returns the columns along x, y, z.
#[inline(always)]
fn at_corner<V: Vector<f32>>(links: &Links<V>, corner: usize) -> [[V; 3]; 3] {
    [
        links[0][beside(0, corner)],
        links[1][beside(1, corner)],
        links[2][beside(2, corner)],
    ]
}

#[inline(always)]
fn cross<V: Vector<f32>>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [
        a[1].mul(b[2]).sub(a[2].mul(b[1])),
        a[2].mul(b[0]).sub(a[0].mul(b[2])),
        a[0].mul(b[1]).sub(a[1].mul(b[0])),
    ]
}

#[inline(always)]
fn dot<V: Vector<f32>>(a: [V; 3], b: [V; 3]) -> V {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

/// Spreads forces from links to nodes.
#[inline(always)]
fn spread<V: Vector<f32>>(grid: &Grid, forces: &Links<V>, out: &mut Sides, at: usize) {
    for c in 0..3 {
        let mut nodes = [V::splat(0.0); 8];
        for axis in 0..3 {
            for beside in 0..4 {
                let low = lowest(axis, beside);
                let high = low | 1 << axis;
                nodes[high] = nodes[high].add(forces[axis][beside][c]);
                nodes[low] = nodes[low].sub(forces[axis][beside][c]);
            }
        }
        for (n, node) in nodes.into_iter().enumerate() {
            let side = if n & 1 == 0 { &mut out.sum } else { &mut out.next };
            let from = at + grid.step(n & !1);
            let to: &mut [f32; ROW] = (&mut side[c][from..from + ROW]).try_into().expect("a row");
            V::load(to).add(node).store(to);
        }
    }
}
