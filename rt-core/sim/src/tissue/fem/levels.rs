//! The levels of the multigrid, from the finest cells to ever coarser ones.

use super::grid::{Grid, corners};
use super::hexahedron::Stiffness;
use super::lanes::LANES;
use super::level::Level;
use super::real::Real;
use super::sweep::{Field, LineOp, Planes, sweep, zeros};
use crate::simd::Simd;

/// Number of free nodes below which the coarsest level is solved directly.
const DIRECT_NODES: usize = 30;

/// Cells that a level is made from, in f64.
pub(super) struct Cells {
    pub grid: Grid,
    pub stiffness: Vec<Stiffness>,
    pub springs_n_per_m: Vec<f64>,
    pub fixed: Vec<bool>,
}

impl Cells {
    /// Makes cells and nodes without stiffness, springs or fixed nodes.
    pub fn empty(grid: Grid) -> Self {
        Cells {
            stiffness: vec![Stiffness::default(); grid.len()],
            springs_n_per_m: vec![0.0; grid.len()],
            fixed: vec![false; grid.len()],
            grid,
        }
    }
}

impl<T: Real> Level<T> {
    pub fn new(cells: &Cells, work: &mut Planes<T>) -> Self {
        // Rows are done in whole lanes, the last one past the end.
        let past = [Stiffness::default(); LANES];
        let part = |f: fn(&Stiffness) -> f64| cells.stiffness.iter().chain(&past).map(|s| T::of(f(s))).collect();
        let mut level = Level {
            stiffness: [part(|s| s.mean), part(|s| s.varying), part(|s| s.shear)],
            springs: cells.springs_n_per_m.iter().map(|&s| T::of(s)).collect(),
            inverse_diagonal: inverse_diagonal(cells),
            largest_eigenvalue: 1.0,
            simd: Simd::detect(),
            grid: cells.grid.clone(),
        };
        level.largest_eigenvalue = largest_eigenvalue(&level, work).min(bound(cells));
        level
    }
}

/// Makes the levels from the finest to the coarsest, which is factored.
pub(super) fn levels<T: Real>(cells: &Cells) -> Vec<Level<T>> {
    let mut work = Planes::new(cells.grid.stride * cells.grid.nodes[1]);
    let mut levels: Vec<Level<T>> = vec![Level::new(cells, &mut work)];
    let mut last = coarser(cells);
    loop {
        let finest = &levels[levels.len() - 1];
        let free = finest.inverse_diagonal.iter().filter(|&&d| d != T::ZERO).count();
        if free <= DIRECT_NODES || last.grid.nodes == finest.grid.nodes {
            return levels;
        }
        levels.push(Level::new(&last, &mut work));
        last = coarser(&last);
    }
}

fn inverse_diagonal<T: Real>(cells: &Cells) -> Vec<T> {
    let grid = &cells.grid;
    let mut diagonal = cells.springs_n_per_m.clone();
    for (cell, stiffness) in cells.stiffness.iter().enumerate() {
        if *stiffness != Stiffness::default() {
            for corner in corners(grid, cell) {
                diagonal[corner] += stiffness.diagonal();
            }
        }
    }
    let free = diagonal.iter().zip(&cells.fixed);
    free.map(|(&d, &fixed)| if d > 0.0 && !fixed { T::of(1.0 / d) } else { T::ZERO })
        .collect()
}

/// Returns a bound of all eigenvalues: the largest of any element over its own diagonal (Rayleigh quotient, element by
/// element).
fn bound(cells: &Cells) -> f64 {
    let stiff = cells.stiffness.iter().filter(|s| **s != Stiffness::default());
    let ratios = stiff.map(|s| s.largest_eigenvalue() / s.diagonal());
    ratios.fold(1.0, f64::max)
}

struct Rayleigh<'a, T> {
    inverse_diagonal: &'a [T],
    largest: f64,
}

impl<T: Real> LineOp<T> for Rayleigh<'_, T> {
    #[inline(always)]
    fn line(&mut self, at: std::ops::Range<usize>, forces: [&[T]; 3], x: [&mut [T]; 3]) {
        let inverse = &self.inverse_diagonal[at];
        for (x, force) in x.into_iter().zip(forces) {
            for ((x, &force), &inverse) in x.iter_mut().zip(force).zip(inverse) {
                *x = force * inverse;
                self.largest = self.largest.max(x.to_f64().abs());
            }
        }
    }
}

/// Estimates the largest eigenvalue by power iteration from a checkerboard with some disorder; with a margin, as it
/// comes from below.
fn largest_eigenvalue<T: Real>(level: &Level<T>, work: &mut Planes<T>) -> f64 {
    const ITERATIONS: usize = 24;
    const MARGIN: f64 = 1.08;
    let mut x: Field<T> = zeros(level.grid.len());
    for (component, values) in x.iter_mut().enumerate() {
        for (node, value) in values.iter_mut().enumerate() {
            let mixed = (node as u64 * 3 + component as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
            let sign = if level.grid.place(node).iter().sum::<usize>().is_multiple_of(2) {
                1.0
            } else {
                -1.0
            };
            let size = sign * (0.5 + mixed as f64 / (1_u64 << 24) as f64);
            let free = level.inverse_diagonal.get(node).is_some_and(|&d| d != T::ZERO);
            *value = T::of(if free { size } else { 0.0 });
        }
    }
    let mut eigenvalue = 1.0;
    for _ in 0..ITERATIONS {
        let mut op = Rayleigh {
            inverse_diagonal: &level.inverse_diagonal,
            largest: 0.0,
        };
        let before = norm(&x);
        sweep(level, &mut x, work, 0..level.grid.nodes[2], &mut op);
        let after = norm(&x);
        if !(after > 0.0 && before > 0.0) {
            return 1.0;
        }
        eigenvalue = after / before;
        let scale = T::of(1.0 / op.largest);
        x.iter_mut().flatten().for_each(|value| *value = *value * scale);
    }
    eigenvalue * MARGIN
}

fn norm<T: Real>(x: &Field<T>) -> f64 {
    x.iter().flatten().map(|v| v.to_f64().powi(2)).sum::<f64>().sqrt()
}

/// Returns the same body on a grid of twice the edge: each cell as stiff as its eight children on average (exact where
/// the strain is constant), springs shared out by interpolation, nodes fixed where a fixed node is.
pub(super) fn coarser(fine: &Cells) -> Cells {
    let used = |cell: usize| fine.stiffness[cell] != Stiffness::default();
    let cells = fine.grid.nodes.map(|n| (n - 1) / 2);
    let place = |cell: usize| fine.grid.place(cell).map(|c| c / 2);
    let all = 0..fine.grid.len();
    let grid = Grid::new(cells, all.clone().filter(|&c| used(c)).map(place));
    let mut coarse = Cells::empty(grid);
    for cell in all {
        if used(cell) {
            // Twice the edge, an eighth of the sum.
            let sum = &mut coarse.stiffness[coarse.grid.index(place(cell))];
            sum.mean += fine.stiffness[cell].mean / 4.0;
            sum.varying += fine.stiffness[cell].varying / 4.0;
            sum.shear += fine.stiffness[cell].shear / 4.0;
        }
        share_node(fine, &mut coarse, cell);
    }
    coarse
}

fn share_node(fine: &Cells, coarse: &mut Cells, node: usize) {
    let place = fine.grid.place(node);
    let odd = place.map(|c| c % 2);
    if odd == [0, 0, 0] {
        coarse.fixed[coarse.grid.index(place.map(|c| c / 2))] = fine.fixed[node];
    }
    let spring = fine.springs_n_per_m[node];
    if spring == 0.0 {
        return;
    }
    let parents = 1 << odd.iter().sum::<usize>();
    for corner in 0..8 {
        let step = [corner & 1, corner >> 1 & 1, corner >> 2];
        if (0..3).all(|a| step[a] <= odd[a]) {
            let parent = coarse.grid.index([0, 1, 2].map(|a| place[a] / 2 + step[a]));
            coarse.springs_n_per_m[parent] += spring / f64::from(parents);
        }
    }
}
