//! The levels of a model with only the nodes in use, numbered x fastest.

use super::LOADS;
use super::kernel::{nothing, product};
use super::support::Support;
use crate::scene::Lattice;
use crate::simd::Simd;
use crate::tissue::fem::level::Level;
use crate::tissue::fem::model::FemModel;
use crate::tissue::fem::real::Real;
use std::ops::Range;
use std::sync::Arc;

/// A grid place that no element touches.
pub(super) const NO_NODE: u32 = u32::MAX;

/// Neighbouring elements along x: their nodes are consecutive in each of the four lines around them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub first_element: u32,
    pub len: u32,
    /// First nodes of the lines at (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1).
    pub lines: [u32; 4],
}

/// One plane of nodes and the elements above it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub first_node: u32,
    pub first_run: u32,
}

#[derive(Clone, Debug)]
pub(super) struct BatchLevel<T> {
    pub node_count: usize,
    /// One for each plane of nodes, and one past the end.
    pub planes: Vec<Plane>,
    pub runs: Vec<Run>,
    /// `mean`, `varying`, `shear` of each element, N/m.
    pub stiffness: Vec<[T; 3]>,
    pub springs: Vec<T>,
    /// One over the diagonal; zero at nodes that do not move.
    pub inverse_diagonal: Vec<T>,
    pub largest_eigenvalue: f64,
    /// Nodes of the next level that each node lies between: `parents[first_parent[n]..first_parent[n + 1]]`, equal
    /// weights.
    pub first_parent: Vec<u32>,
    pub parents: Vec<u32>,
    pub simd: Simd,
    /// Node at each place of the level's grid.
    pub(super) node_at: Vec<u32>,
}

/// Part of a body that no element joins to the rest of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// Elements of it.
    pub elements: Vec<Range<u32>>,
    /// Displacement as one piece for each newton, on its springs to rest, m/N; 0 where something in it is fixed.
    pub m_per_n: f64,
}

/// Body on which eight loads are solved: built once from a model, never changed.
#[derive(Clone, Debug)]
pub struct BatchModel<T = f32> {
    /// Finest first.
    pub(super) levels: Vec<BatchLevel<T>>,
    /// Inverse of the coarsest level's matrix on its free nodes, row by row.
    pub(super) coarsest: Vec<T>,
    pub(super) coarsest_nodes: Vec<u32>,
    /// The lowest corner node of each element of the lattice, by line as in [`Run`].
    pub(super) corners: Vec<[u32; 4]>,
    lattice: Arc<Lattice>,
    /// Number of the part of each node of the finest level.
    pub(super) part_of_node: Vec<u32>,
    pub(super) parts: Vec<Part>,
    /// Layers around the body.
    pub(super) supports: Vec<Support<T>>,
    /// Shear modulus and Poisson's ratio of each element; zero where it is rigid.
    materials: Vec<[f32; 2]>,
    low_m: [f64; 3],
    nodes: [usize; 3],
    stride: usize,
}

impl<T: Real> BatchModel<T> {
    pub(super) fn of_model(model: &FemModel<T>) -> Self {
        let mut levels: Vec<BatchLevel<T>> = model.levels.iter().map(compact).collect();
        for &node in model.loose.iter().flatten() {
            let at = levels[0].node_at[node as usize] as usize;
            levels[0].inverse_diagonal[at] = T::ZERO;
        }
        for n in 1..levels.len() {
            let (fine, coarse) = levels.split_at_mut(n);
            let grids = [&model.levels[n - 1], &model.levels[n]];
            find_parents(&mut fine[n - 1], &coarse[0], grids);
        }
        let grid = &model.levels[0].grid;
        let spacing_m = model.lattice.spacing_m;
        let corner = |cell: usize| {
            let lines = [
                0,
                grid.stride,
                grid.stride * grid.nodes[1],
                grid.stride * (grid.nodes[1] + 1),
            ];
            lines.map(|step| levels[0].node_at[cell + step])
        };
        let material = |cell: usize| {
            let [mean, _, shear] = [0, 1, 2].map(|part: usize| model.levels[0].stiffness[part][cell].to_f64());
            let poisson = 0.5 * mean / (mean + shear);
            [
                16.0 * shear / spacing_m,
                if poisson.is_finite() { poisson } else { 0.0 },
            ]
            .map(|v| v as f32)
        };
        let mut batch = BatchModel {
            corners: model
                .runs
                .iter()
                .flat_map(|run| (run.cell..run.cell + run.len).map(corner))
                .collect(),
            lattice: model.lattice.clone(),
            part_of_node: Vec::new(),
            parts: Vec::new(),
            supports: Vec::new(),
            materials: model
                .runs
                .iter()
                .flat_map(|run| (run.cell..run.cell + run.len).map(material))
                .collect(),
            low_m: model.low_cell.map(|c| c as f64 * spacing_m),
            nodes: grid.nodes,
            stride: grid.stride,
            coarsest: Vec::new(),
            coarsest_nodes: Vec::new(),
            levels,
        };
        batch.invert_coarsest();
        batch.find_parts(model);
        batch
    }

    /// Returns the number of nodes in use of the finest level.
    pub fn node_count(&self) -> usize {
        self.levels[0].node_count
    }

    /// Returns the number of elements of the lattice.
    pub fn element_count(&self) -> usize {
        self.corners.len()
    }

    /// Returns the lattice of the elements.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Returns the edge of a cell, m.
    pub fn spacing_m(&self) -> f64 {
        self.lattice.spacing_m
    }

    /// Returns shear modulus in pascals and Poisson's ratio at a point; `None` where nothing elastic is.
    pub fn material(&self, point_m: [f64; 3]) -> Option<[f64; 2]> {
        let is_number = point_m.iter().all(|c| *c >= 0.0);
        let element = self.lattice.element_at_rest(point_m).filter(|_| is_number)?;
        let [shear_pa, poisson] = self.materials.get(element as usize)?.map(f64::from);
        (shear_pa > 0.0).then_some([shear_pa, poisson])
    }

    /// Returns the nodes around a point in the scene frame with their trilinear weights; `None` where no element is.
    pub fn trilinear(&self, point_m: [f64; 3]) -> Option<[(u32, f64); 8]> {
        let place = [0, 1, 2].map(|a| (point_m[a] - self.low_m[a]) / self.spacing_m());
        if !place.iter().all(|p| *p >= 0.0) {
            return None;
        }
        let cell = place.map(|p| p as usize);
        if (0..3).any(|a| cell[a] + 1 >= self.nodes[a]) {
            return None;
        }
        let part = [0, 1, 2].map(|a| place[a] - cell[a] as f64);
        let mut nodes = [(0, 0.0); 8];
        for (corner, slot) in nodes.iter_mut().enumerate() {
            let step = [corner & 1, corner >> 1 & 1, corner >> 2];
            let [i, j, k] = [0, 1, 2].map(|a| cell[a] + step[a]);
            let weight = [0, 1, 2].map(|a| if step[a] == 1 { part[a] } else { 1.0 - part[a] });
            let node = self.levels[0].node_at[i + self.stride * (j + self.nodes[1] * k)];
            if node == NO_NODE {
                return None;
            }
            *slot = (node, weight.iter().product());
        }
        Some(nodes)
    }

    /// Returns whether a node can move.
    pub fn is_free(&self, node: u32) -> bool {
        self.levels[0]
            .inverse_diagonal
            .get(node as usize)
            .is_some_and(|&d| d != T::ZERO)
    }

    /// Returns the size of the model, in bytes.
    pub fn bytes(&self) -> usize {
        let level = |l: &BatchLevel<T>| {
            l.node_count * (2 * size_of::<T>() + 4)
                + l.stiffness.len() * size_of::<[T; 3]>()
                + 4 * (l.parents.len() + l.node_at.len())
        };
        let of_layers = self.supports.iter().map(Support::bytes).sum::<usize>();
        let of_body = self.levels.iter().map(level).sum::<usize>() + self.coarsest.len() * size_of::<T>();
        of_layers + of_body + 16 * self.corners.len()
    }

    /// Computes the pseudo-inverse of the coarsest level, so that a part without stiffness stays where it is.
    fn invert_coarsest(&mut self) {
        let level = &self.levels[self.levels.len() - 1];
        let free = (0..level.node_count as u32).filter(|&n| level.inverse_diagonal[n as usize] != T::ZERO);
        self.coarsest_nodes = free.collect();
        if self.coarsest_nodes.is_empty() {
            // Layers thinner than the coarsest cells: those correct nothing.
            return;
        }
        let size = 3 * self.coarsest_nodes.len();
        if size == 0 {
            // A thin layer: all that is coarse touches what is fixed.
            return;
        }
        let mut matrix = nalgebra::DMatrix::<f64>::zeros(size, size);
        let nodes = &self.coarsest_nodes;
        let mut x = vec![nothing(); level.node_count];
        for first in (0..size).step_by(LOADS) {
            let columns = first..size.min(first + LOADS);
            for (lane, c) in columns.clone().enumerate() {
                x[nodes[c / 3] as usize][c % 3].0[lane] = T::of(1.0);
            }
            let forces = product(level, &mut x);
            for (lane, c) in columns.enumerate() {
                x[nodes[c / 3] as usize][c % 3].0[lane] = T::ZERO;
                for r in 0..size {
                    matrix[(r, c)] = forces[nodes[r / 3] as usize][r % 3].0[lane].to_f64();
                }
            }
        }
        let symmetric = (&matrix + matrix.transpose()) * 0.5;
        let eigen = symmetric.symmetric_eigen();
        let least = 64.0 * T::EPSILON * eigen.eigenvalues.iter().fold(0.0, |m: f64, v| m.max(*v));
        let inverse = eigen.eigenvalues.map(|v| if v > least { 1.0 / v } else { 0.0 });
        let scaled = &eigen.eigenvectors * nalgebra::DMatrix::from_diagonal(&inverse);
        let product = scaled * eigen.eigenvectors.transpose();
        self.coarsest = product.transpose().iter().map(|&v| T::of(v)).collect();
    }
}

impl<T> BatchLevel<T> {
    /// Parents of each node.
    pub fn parents(&self) -> impl Iterator<Item = &[u32]> {
        let of_node = |ends: &[u32]| &self.parents[ends[0] as usize..ends[1] as usize];
        self.first_parent.windows(2).map(of_node)
    }
}

fn compact<T: Real>(level: &Level<T>) -> BatchLevel<T> {
    let grid = &level.grid;
    let cells: Vec<usize> = (0..grid.len())
        .filter(|&cell| level.stiffness[2][cell] != T::ZERO)
        .collect();
    let mut node_at = vec![NO_NODE; grid.len()];
    for &cell in &cells {
        crate::tissue::fem::grid::corners(grid, cell)
            .into_iter()
            .for_each(|node| node_at[node] = 0);
    }
    // A rigid structure has no stiffness, but its nodes may carry springs or loads: they do not move.
    let mut used = Vec::new();
    for (at, node) in node_at.iter_mut().enumerate().filter(|(_, node)| **node != NO_NODE) {
        *node = used.len() as u32;
        used.push(at);
    }
    let plane_size = grid.stride * grid.nodes[1];
    let mut runs: Vec<Run> = Vec::new();
    let mut stiffness = Vec::with_capacity(cells.len());
    let mut planes = Vec::with_capacity(grid.nodes[2] + 1);
    let mut next = cells.iter().copied().peekable();
    for k in 0..grid.nodes[2] {
        planes.push(Plane {
            first_node: used.partition_point(|&at| at < k * plane_size) as u32,
            first_run: runs.len() as u32,
        });
        let mut last = usize::MAX;
        while let Some(cell) = next.next_if(|&cell| cell < (k + 1) * plane_size) {
            match runs.last_mut() {
                Some(run) if last != usize::MAX && cell == last + 1 => run.len += 1,
                _ => runs.push(Run {
                    first_element: stiffness.len() as u32,
                    len: 1,
                    lines: [0, grid.stride, plane_size, plane_size + grid.stride].map(|step| node_at[cell + step]),
                }),
            }
            stiffness.push([0, 1, 2].map(|part: usize| level.stiffness[part][cell]));
            last = cell;
        }
    }
    planes.push(Plane {
        first_node: used.len() as u32,
        first_run: runs.len() as u32,
    });
    BatchLevel {
        node_count: used.len(),
        planes,
        runs,
        stiffness,
        springs: used.iter().map(|&at| level.springs[at]).collect(),
        inverse_diagonal: used.iter().map(|&at| level.inverse_diagonal[at]).collect(),
        largest_eigenvalue: level.largest_eigenvalue,
        first_parent: Vec::new(),
        parents: Vec::new(),
        simd: level.simd,
        node_at,
    }
}

fn find_parents<T: Real>(fine: &mut BatchLevel<T>, coarse: &BatchLevel<T>, [from, to]: [&Level<T>; 2]) {
    fine.first_parent.push(0);
    for (at, _) in fine.node_at.iter().enumerate().filter(|(_, node)| **node != NO_NODE) {
        let place = from.grid.place(at);
        for corner in 0..8 {
            let step = [corner & 1, corner >> 1 & 1, corner >> 2];
            if (0..3).all(|a| step[a] <= place[a] % 2) {
                let parent = coarse.node_at[to.grid.index([0, 1, 2].map(|a| place[a] / 2 + step[a]))];
                fine.parents.push(parent);
            }
        }
        fine.first_parent.push(fine.parents.len() as u32);
    }
}
