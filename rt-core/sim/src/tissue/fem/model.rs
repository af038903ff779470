//! Model of an elastic body: built once, never changed.

use super::grid::{Grid, corners};
use super::hexahedron::Stiffness;
use super::level::Level;
use super::levels::{Cells, coarser, levels};
use super::material::{FemProblem, FemSettings, Structure, problems_of};
use super::reaction::Reaction;
use super::real::Real;
use crate::scene::Lattice;
use std::sync::Arc;
use stylet_anatomy::Beyond;
use stylet_settings::ProblemList;

/// A node that touches no element.
pub(super) const NO_PART: u32 = u32::MAX;

/// A stretch of elements with consecutive numbers, and the cell of the first.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellRun {
    pub first: usize,
    pub len: usize,
    pub cell: usize,
}

/// Topology, materials and all levels of the multigrid, in `f32` or `f64`.
#[derive(Clone, Debug)]
pub struct FemModel<T = f32> {
    pub(super) lattice: Arc<Lattice>,
    /// Finest first.
    pub(super) levels: Vec<Level<T>>,
    /// Lattice cell at the lowest corner of the finest grid.
    pub(super) low_cell: [usize; 3],
    pub(super) runs: Vec<CellRun>,
    pub(super) is_cell: Vec<bool>,
    /// Part of the body that each node belongs to; parts share no node.
    pub(super) part: Vec<u32>,
    /// Nodes of the parts that neither springs nor fixed nodes keep in place.
    pub(super) loose: Vec<Vec<u32>>,
    /// Forces of the layers around the body beyond those of its springs.
    pub(super) reactions: Vec<Reaction>,
}

impl<T: Real> FemModel<T> {
    /// Makes the body of `lattice` in the elements of `of`, which is that lattice or a coarser one of it.
    pub(super) fn of_lattice(
        lattice: &Lattice,
        of: &Arc<Lattice>,
        settings: &FemSettings,
        is_fixed: &dyn Fn([f64; 3]) -> bool,
    ) -> Result<Self, ProblemList<FemProblem>> {
        ProblemList::check(problems_of(settings, lattice.element_count()))?;
        let halvings = (of.spacing_m / lattice.spacing_m).log2().round() as u32;
        let mut body = Body::new(lattice, settings, is_fixed, 1 << halvings);
        for _ in 0..halvings {
            body.cells = coarser(&body.cells);
        }
        body.set_elements(of, 1 << halvings);
        let (part, anchored) = parts(&body);
        let mut loose = vec![Vec::new(); anchored.len()];
        for (node, &part) in part.iter().enumerate() {
            if part != NO_PART && !anchored[part as usize] {
                loose[part as usize].push(node as u32);
            }
        }
        loose.retain(|nodes| !nodes.is_empty());
        Ok(FemModel {
            lattice: of.clone(),
            levels: levels(&body.cells),
            low_cell: body.low_cell,
            runs: body.runs,
            is_cell: body.is_cell,
            part,
            loose,
            reactions: Vec::new(),
        })
    }

    /// Returns whether springs or something fixed hold the part of the body that an element belongs to.
    pub fn is_held(&self, element: u32) -> bool {
        let part = self.part_of_element(element);
        let is_it = |node: &u32| self.part.get(*node as usize) == Some(&part);
        !self.loose.iter().any(|nodes| nodes.first().is_some_and(is_it))
    }

    /// Returns the part of the body that an element belongs to.
    pub(super) fn part_of_element(&self, element: u32) -> u32 {
        let cell = self.lattice.cell(element);
        let place = [0, 1, 2].map(|a| cell[a].saturating_sub(self.low_cell[a]));
        self.part
            .get(self.levels[0].grid.index(place))
            .copied()
            .unwrap_or(NO_PART)
    }

    /// Returns whether a node of a part of the body is fixed.
    pub(super) fn is_fixed_somewhere(&self, part: u32) -> bool {
        let mut nodes = self.part.iter().zip(&self.levels[0].inverse_diagonal);
        nodes.any(|(of, inverse)| *of == part && *inverse == T::ZERO)
    }

    /// Returns the elements and their neighbours.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Returns the number of elements.
    pub fn element_count(&self) -> usize {
        self.lattice.element_count()
    }
}

struct Body {
    cells: Cells,
    low_cell: [usize; 3],
    runs: Vec<CellRun>,
    is_cell: Vec<bool>,
}

impl Body {
    /// Makes the model in the cells of `lattice`; its lowest cell is the lowest of a group of `aligned_to` cells along
    /// each axis.
    fn new(lattice: &Lattice, settings: &FemSettings, is_fixed: impl Fn([f64; 3]) -> bool, aligned_to: usize) -> Self {
        let edge_m = lattice.spacing_m;
        let [low, high] = lattice.occupied();
        let low_cell = low.map(|c| c / aligned_to * aligned_to);
        let size = [0, 1, 2].map(|a| high[a] - low_cell[a]);
        let mut body = Body {
            low_cell,
            runs: Vec::new(),
            is_cell: Vec::new(),
            cells: Cells::empty(Grid::new(size, cells_of(lattice, low_cell))),
        };
        body.set_elements(lattice, 1);
        for (element, cell) in cells_of(lattice, low_cell).enumerate() {
            let cell = body.cells.grid.index(cell);
            body.add_element(element, cell, settings, edge_m);
        }
        body.add_surroundings(lattice, settings);
        for node in 0..body.cells.grid.len() {
            let place = body.cells.grid.place(node);
            let place_m = [0, 1, 2].map(|a| (place[a] + low_cell[a]) as f64 * edge_m);
            body.cells.fixed[node] |= is_fixed(place_m);
        }
        body
    }

    /// Sets the places of the elements of `lattice` in the grid, whose cells are that many of the first lattice along
    /// each axis.
    fn set_elements(&mut self, lattice: &Lattice, cells_along_edge: usize) {
        self.low_cell = self.low_cell.map(|c| c / cells_along_edge);
        self.is_cell = vec![false; self.cells.grid.len()];
        self.runs.clear();
        for (element, cell) in cells_of(lattice, self.low_cell).enumerate() {
            let cell = self.cells.grid.index(cell);
            self.is_cell[cell] = true;
            match self.runs.last_mut() {
                Some(run) if run.cell + run.len == cell && !cell.is_multiple_of(self.cells.grid.stride) => run.len += 1,
                _ => self.runs.push(CellRun {
                    first: element,
                    len: 1,
                    cell,
                }),
            }
        }
    }

    fn add_element(&mut self, element: usize, cell: usize, settings: &FemSettings, edge_m: f64) {
        let structure = settings.structure_of.get(element).copied().unwrap_or(0);
        match &settings.structures[usize::from(structure)] {
            Structure::Elastic(material) => self.cells.stiffness[cell] = Stiffness::of(material, edge_m),
            Structure::Fixed => corners(&self.cells.grid, cell)
                .into_iter()
                .for_each(|node| self.cells.fixed[node] = true),
        }
    }

    /// Adds a quarter of the springs of each outside face to each of its nodes, by what lies beyond it.
    fn add_surroundings(&mut self, lattice: &Lattice, settings: &FemSettings) {
        let quarter_n_per_m = settings.foundation_pa_per_m * lattice.spacing_m.powi(2) / 4.0;
        let grid = &self.cells.grid;
        for (element, cell) in cells_of(lattice, self.low_cell).enumerate() {
            let cell = grid.index(cell);
            let nodes = corners(grid, cell);
            let structure = settings.structure_of.get(element).copied().unwrap_or(0);
            let surroundings = settings
                .surroundings
                .get(usize::from(structure))
                .copied()
                .unwrap_or_default();
            for (face, beyond) in surroundings.0.into_iter().enumerate() {
                let (axis, is_upper) = (face / 2, face % 2 == 1);
                let step = grid.index([0, 1, 2].map(|a| usize::from(a == axis)));
                let other = if is_upper {
                    cell.checked_add(step)
                } else {
                    cell.checked_sub(step)
                };
                if other.and_then(|c| self.is_cell.get(c)) == Some(&true) {
                    continue;
                }
                let of_face = nodes
                    .iter()
                    .enumerate()
                    .filter(|(corner, _)| (corner >> axis & 1 == 1) == is_upper);
                of_face.for_each(|(_, &node)| match beyond {
                    Beyond::Fat => self.cells.springs_n_per_m[node] += quarter_n_per_m,
                    Beyond::Fixed => self.cells.fixed[node] = true,
                    Beyond::Free => {}
                });
            }
        }
    }
}

/// Iterates over the cells of the elements in their order, counted from `low_cell`.
fn cells_of(lattice: &Lattice, low_cell: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..lattice.element_count() as u32).map(move |element| {
        let cell = lattice.cell(element);
        [0, 1, 2].map(|a| cell[a] - low_cell[a])
    })
}

/// Returns the part of each node, and whether the part has a spring or a fixed node.
fn parts(body: &Body) -> (Vec<u32>, Vec<bool>) {
    let grid = &body.cells.grid;
    let mut part = vec![NO_PART; grid.len()];
    let mut anchored = Vec::new();
    let mut open = Vec::new();
    for cell in (0..grid.len()).filter(|&cell| body.is_cell[cell]) {
        if part[cell] != NO_PART {
            continue;
        }
        let number = anchored.len() as u32;
        anchored.push(false);
        part[cell] = number;
        open.push(cell);
        while let Some(node) = open.pop() {
            let kept = body.cells.fixed[node] || body.cells.springs_n_per_m[node] > 0.0;
            anchored[number as usize] |= kept;
            for cell in corners(grid, 0).into_iter().filter_map(|back| node.checked_sub(back)) {
                if body.is_cell[cell] {
                    for next in corners(grid, cell) {
                        if part[next] == NO_PART {
                            part[next] = number;
                            open.push(next);
                        }
                    }
                }
            }
        }
    }
    (part, anchored)
}
