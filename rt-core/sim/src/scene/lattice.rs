//! The lattice of cubic elements cut from a label volume, and the map between elements and cells.

use super::Labels;

/// A maximal stretch of neighbouring elements along x; its elements have consecutive numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    pub first: u32,
    pub len: u32,
    pub start_i: u32,
}

impl Run {
    /// Returns one past the last element.
    pub fn end(&self) -> u32 {
        self.first + self.len
    }
}

/// Elements in the order x fastest, then y, then z. Never empty once it is part of a `Scene`.
///
/// Only occupied cells take memory: a row of cells knows its runs, so a mostly empty volume stays small.
#[derive(Clone, Debug)]
pub struct Lattice {
    /// Cells along x, y, z.
    pub dims: [usize; 3],
    /// Edge of a cubic element.
    pub spacing_m: f64,
    cells: Vec<[u16; 3]>,
    /// Number of each element's structure in the scene's list; empty if there is only one.
    structures: Vec<u8>,
    runs: Vec<Run>,
    /// First run of each row `j + dims[1] * k`, with one more entry at the end.
    row_runs: Vec<u32>,
    /// Lowest and one past the highest cell that is occupied.
    occupied: [[usize; 3]; 2],
}

impl Lattice {
    /// Expects labels that `Scene::from_labels` has accepted.
    pub(crate) fn from_checked_labels(labels: &Labels) -> Self {
        let number_of_label = |label: u8| labels.structures.iter().position(|s| s.label == label).unwrap_or(0) as u8;
        let mut lattice = Self::of_cells(labels.dims, labels.spacing_m, &labels.cells);
        if labels.structures.len() > 1 {
            let tissue = labels.cells.iter().filter(|&&label| label != 0);
            lattice.structures = tissue.map(|&label| number_of_label(label)).collect();
        }
        lattice
    }

    /// Makes one structure of all cells but those of zero.
    pub(crate) fn of_cells(dims: [usize; 3], spacing_m: f64, cells: &[u8]) -> Self {
        let [nx, ny, nz] = dims;
        let mut lattice = Lattice {
            dims,
            spacing_m,
            cells: Vec::new(),
            structures: Vec::new(),
            runs: Vec::new(),
            row_runs: Vec::with_capacity(ny * nz + 1),
            occupied: [[0; 3]; 2],
        };
        for (row_index, row) in cells.chunks_exact(nx).enumerate() {
            lattice.row_runs.push(lattice.runs.len() as u32);
            lattice.push_row(row, row_index % ny, row_index / ny);
        }
        lattice.row_runs.push(lattice.runs.len() as u32);
        lattice.occupied = occupied_box(&lattice.cells);
        lattice
    }

    /// Returns a lattice with elements of twice the edge wherever any of their eight cells is tissue, each of the
    /// structure that most of those have; the same scene frame.
    pub fn coarser(&self) -> Lattice {
        let dims = self.dims.map(|n| n.div_ceil(2));
        let index = |cell: &[u16; 3]| {
            let [i, j, k] = cell.map(|c| usize::from(c) / 2);
            i + dims[0] * (j + dims[1] * k)
        };
        let mut tissue = vec![0_u8; dims.iter().product()];
        // Coarse cell, structure.
        let mut members: Vec<(u32, u8)> = Vec::with_capacity(self.cells.len());
        for (element, cell) in self.cells.iter().enumerate() {
            let at = index(cell);
            tissue[at] = 1;
            members.push((at as u32, self.structure(element as u32)));
        }
        let mut coarse = Self::of_cells(dims, 2.0 * self.spacing_m, &tissue);
        if !self.structures.is_empty() {
            members.sort_unstable();
            let of_cell = members.chunk_by(|a, b| a.0 == b.0);
            coarse.structures = of_cell.map(most_common).collect();
        }
        coarse
    }

    fn push_row(&mut self, row: &[u8], j: usize, k: usize) {
        let mut inside = false;
        for (i, &label) in row.iter().enumerate() {
            if label != 0 {
                if !inside {
                    self.runs.push(Run {
                        first: self.cells.len() as u32,
                        len: 0,
                        start_i: i as u32,
                    });
                }
                if let Some(run) = self.runs.last_mut() {
                    run.len += 1;
                }
                self.cells.push([i as u16, j as u16, k as u16]);
            }
            inside = label != 0;
        }
    }

    /// Returns the number of elements.
    pub fn element_count(&self) -> usize {
        self.cells.len()
    }

    /// Returns the cell of an element; the last element's for a number past the end.
    pub fn cell(&self, element: u32) -> [usize; 3] {
        let last = self.cells.len().saturating_sub(1);
        let cell = self.cells.get((element as usize).min(last));
        cell.map_or([0; 3], |c| c.map(usize::from))
    }

    /// Returns the centre of an element at rest, in the scene frame.
    pub fn rest_m(&self, element: u32) -> [f64; 3] {
        self.cell(element).map(|c| (c as f64 + 0.5) * self.spacing_m)
    }

    /// Returns the element in a cell; `None` where there is no tissue.
    pub fn element_of_cell(&self, i: usize, j: usize, k: usize) -> Option<u32> {
        if j >= self.dims[1] || k >= self.dims[2] {
            return None;
        }
        let i = u32::try_from(i).ok()?;
        let runs = self.row(j, k);
        let after = runs.partition_point(|run| run.start_i <= i);
        let run = runs.get(after.checked_sub(1)?)?;
        let offset = i - run.start_i;
        (offset < run.len).then(|| run.first + offset)
    }

    /// Returns the element at a place of the scene frame while the body is at rest.
    pub fn element_at_rest(&self, place_m: [f64; 3]) -> Option<u32> {
        self.element_at(place_m.map(|c| (c / self.spacing_m).floor() as i64))
    }

    /// Returns the element in a cell as `element_of_cell`, for coordinates that may lie below zero.
    pub(crate) fn element_at(&self, [i, j, k]: [i64; 3]) -> Option<u32> {
        let index = |c: i64| usize::try_from(c).ok();
        self.element_of_cell(index(i)?, index(j)?, index(k)?)
    }

    /// Neighbours in the order -x, +x, -y, +y, -z, +z.
    pub fn neighbours(&self, element: u32) -> [Option<u32>; 6] {
        let [i, j, k] = self.cell(element).map(|c| c as i64);
        [
            self.element_at([i - 1, j, k]),
            self.element_at([i + 1, j, k]),
            self.element_at([i, j - 1, k]),
            self.element_at([i, j + 1, k]),
            self.element_at([i, j, k - 1]),
            self.element_at([i, j, k + 1]),
        ]
    }

    /// Returns the number of an element's structure in the scene's list.
    pub fn structure(&self, element: u32) -> u8 {
        self.structures.get(element as usize).copied().unwrap_or(0)
    }

    /// Returns the structure of every element, in their order; empty if there is only one.
    pub fn structures(&self) -> &[u8] {
        &self.structures
    }

    /// Returns the volume of all elements at rest, m^3.
    pub fn volume_m3(&self) -> f64 {
        self.element_count() as f64 * self.spacing_m.powi(3)
    }

    /// Returns the lowest and highest corner of the box around all elements at rest (faces, not centres).
    pub fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        let metres = |corner: [usize; 3]| corner.map(|c| c as f64 * self.spacing_m);
        let [low, high] = self.occupied;
        (metres(low), metres(high))
    }

    /// Returns the lowest and one past the highest cell that is occupied.
    pub fn occupied(&self) -> [[usize; 3]; 2] {
        self.occupied
    }

    /// Returns the size and box of each of the first `count` structures.
    pub fn extents(&self, count: usize) -> Vec<Extent> {
        let mut boxes = vec![(0_u32, [usize::MAX; 3], [0; 3]); count];
        for (element, cell) in self.cells.iter().enumerate() {
            let structure = self.structures.get(element).copied().unwrap_or(0);
            if let Some((elements, low, high)) = boxes.get_mut(structure as usize) {
                *elements += 1;
                widen(low, high, cell);
            }
        }
        let metres = |corner: [usize; 3]| corner.map(|c| c as f64 * self.spacing_m);
        let extents = boxes.into_iter().map(|(elements, low, high)| Extent {
            elements,
            lower_m: metres(if elements > 0 { low } else { [0; 3] }),
            upper_m: metres(high),
        });
        extents.collect()
    }

    /// Runs of the row of cells at `j`, `k`, in the order of x.
    pub(crate) fn row(&self, j: usize, k: usize) -> &[Run] {
        let row = j + self.dims[1] * k;
        &self.runs[self.row_runs[row] as usize..self.row_runs[row + 1] as usize]
    }
}

/// Size of a structure: its elements, and the box around them at rest (faces, not centres).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Number of elements.
    pub elements: u32,
    /// Lowest corner, m.
    pub lower_m: [f64; 3],
    /// Highest corner, m.
    pub upper_m: [f64; 3],
}

/// Returns the structure of most of a cell's members, which are in order; the first of several.
fn most_common(members: &[(u32, u8)]) -> u8 {
    let of_structure = members.chunk_by(|a, b| a.1 == b.1);
    let most = of_structure.reduce(|most, next| if next.len() > most.len() { next } else { most });
    most.and_then(|members| members.first()).map_or(0, |member| member.1)
}

fn occupied_box(cells: &[[u16; 3]]) -> [[usize; 3]; 2] {
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for cell in cells {
        widen(&mut low, &mut high, cell);
    }
    [low, high]
}

fn widen(low: &mut [usize; 3], high: &mut [usize; 3], cell: &[u16; 3]) {
    for axis in 0..3 {
        low[axis] = low[axis].min(cell[axis] as usize);
        high[axis] = high[axis].max(cell[axis] as usize + 1);
    }
}
