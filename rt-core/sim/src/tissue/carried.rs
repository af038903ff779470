//! A displacement of the whole body that a model has on top of what its own steps do.

use super::field::{add_fields, add_up};
use super::{BodyShift, ElementField, PackedField};
use crate::scene::{Lattice, Scene};
use crate::simd::Simd;
use std::sync::Arc;

/// How a body is to be carried from now on.
#[derive(Clone, Copy, Debug)]
pub enum Carry<'a> {
    /// Not at all.
    Not,
    /// As one piece, on what surrounds it.
    Shift(BodyShift),
    /// By the answers of a coarser body, m/N, to the loads, N: something holds it, so that it cannot move as one piece.
    Columns(&'a [PackedField], &'a [f64]),
    /// As by `Columns`, and by fields of that body as well, m.
    Fields(&'a [PackedField], &'a [f64], &'a [&'a ElementField]),
}

/// How a body is carried.
#[derive(Clone, Copy, Debug, Default)]
pub enum Carried<'a> {
    /// Not at all.
    #[default]
    Not,
    /// As one piece.
    Shift(&'a BodyShift),
    /// By a field of a coarser body.
    Field(&'a CarriedField),
}

impl Carried<'_> {
    /// Displacement of an element, m.
    pub fn at_m(&self, lattice: &Lattice, element: u32) -> [f64; 3] {
        match self {
            Self::Not => [0.0; 3],
            Self::Shift(shift) => shift.at_m(lattice.rest_m(element)),
            Self::Field(field) => field.at_m(lattice, element),
        }
    }

    /// No element is displaced farther, m.
    pub fn largest_m(&self, lattice: &Lattice) -> f64 {
        match self {
            Self::Not => 0.0,
            Self::Shift(shift) => shift.largest_m(lattice),
            Self::Field(field) => f64::from(field.largest_m),
        }
    }
}

/// Takes its displacement from no element.
const NONE: u32 = u32::MAX;

/// Displacements of a coarser body's elements, between whose centres they are interpolated. What is fixed stays.
#[derive(Clone, Debug)]
pub struct CarriedField {
    simd: Simd,
    /// Of each element of the coarser body, m.
    of_element: [Vec<f32>; 3],
    /// The same at each cell of a box with one empty cell around the body: what is beside the body moves with it. The fourth
    /// number is empty, so that a cell is one register.
    of_cell_m: Vec<[f32; 4]>,
    /// Element that a cell of the box takes its displacement from.
    source: Vec<u32>,
    /// Cells of the box along x, y, z.
    dims: [usize; 3],
    /// Where the centres of the scene's cells lie along x, y, z: the cell of the box before it, and how far to the next.
    between: [Vec<(u32, f32)>; 3],
    /// By structure.
    is_fixed: Vec<bool>,
    largest_m: f32,
}

impl CarriedField {
    /// At rest; `coarse` is a coarser lattice of the scene's cells.
    pub fn new(scene: &Scene, coarse: Arc<Lattice>) -> Self {
        let dims = coarse.dims.map(|n| n + 2);
        let source: Vec<u32> = (0..dims.iter().product())
            .map(|at: usize| nearest(&coarse, [at % dims[0], at / dims[0] % dims[1], at / dims[0] / dims[1]]))
            .collect();
        CarriedField {
            simd: Simd::detect(),
            between: [0, 1, 2].map(|a| between(&scene.lattice, &coarse, a)),
            of_element: std::array::from_fn(|_| vec![0.0; coarse.element_count()]),
            of_cell_m: vec![[0.0; 4]; source.len()],
            source,
            dims,
            is_fixed: scene.structures.iter().map(|s| s.material.fixed).collect(),
            largest_m: 0.0,
        }
    }

    /// The sum of loads times answers; does not allocate.
    pub fn set(&mut self, columns: &[PackedField], loads_n: &[f64]) {
        self.set_with(columns, loads_n, &[]);
    }

    /// The same with fields besides, m; does not allocate.
    pub fn set_with(&mut self, columns: &[PackedField], loads_n: &[f64], fields: &[&ElementField]) {
        add_up(self.simd, columns, loads_n, 1.0, &mut self.of_element);
        add_fields(fields, 1.0, &mut self.of_element);
        self.spread();
    }

    /// At rest; does not allocate.
    pub fn clear(&mut self) {
        self.of_element.iter_mut().for_each(|axis| axis.fill(0.0));
        self.spread();
    }

    /// Nothing is displaced by it.
    pub fn is_at_rest(&self) -> bool {
        self.largest_m == 0.0
    }

    fn spread(&mut self) {
        let [x, y, z] = &self.of_element;
        let mut largest = 0.0_f32;
        for (cell, &source) in self.of_cell_m.iter_mut().zip(&self.source) {
            let at = |axis: &Vec<f32>| axis.get(source as usize).copied().unwrap_or(0.0);
            *cell = [at(x), at(y), at(z), 0.0];
            let square = cell.iter().map(|c| c * c).sum::<f32>();
            // What is no number stays, so that nobody takes the answer for one.
            largest = if square <= largest { largest } else { square };
        }
        self.largest_m = largest.sqrt();
    }

    /// Displacement of an element of the scene's lattice, m.
    pub fn at_m(&self, lattice: &Lattice, element: u32) -> [f64; 3] {
        let structure = usize::from(lattice.structure(element));
        if self.is_fixed.get(structure).copied().unwrap_or(false) {
            return [0.0; 3];
        }
        let cell = lattice.cell(element);
        let [x, y, z] = [0, 1, 2].map(|a| self.between[a].get(cell[a]).copied().unwrap_or_default());
        let along_x = |j: usize, k: usize| {
            let at = x.0 as usize + self.dims[0] * (y.0 as usize + j + self.dims[1] * (z.0 as usize + k));
            match self.of_cell_m.get(at..at + 2) {
                Some([a, b]) => mixed(*a, *b, x.1),
                _ => [0.0; 4],
            }
        };
        let along_y = |k: usize| mixed(along_x(0, k), along_x(1, k), y.1);
        let [x_m, y_m, z_m, _] = mixed(along_y(0), along_y(1), z.1);
        [x_m, y_m, z_m].map(f64::from)
    }

    /// Bytes of [`Self::save`].
    pub fn memory_len(&self) -> usize {
        self.of_element.iter().map(|axis| size_of_val(axis.as_slice())).sum()
    }

    /// Writes what the next tick needs; nothing where `to` has another length.
    pub fn save(&self, to: &mut [u8]) {
        if to.len() != self.memory_len() {
            return;
        }
        let mut rest = to;
        for axis in &self.of_element {
            let bytes: &[u8] = bytemuck::cast_slice(axis);
            let (part, left) = rest.split_at_mut(bytes.len());
            part.copy_from_slice(bytes);
            rest = left;
        }
    }

    /// Takes up what another field of the same body saved; nothing where `from` has another length.
    pub fn load(&mut self, from: &[u8]) {
        if from.len() != self.memory_len() {
            return;
        }
        let mut rest = from;
        for axis in &mut self.of_element {
            let bytes: &mut [u8] = bytemuck::cast_slice_mut(axis);
            let (part, left) = rest.split_at(bytes.len());
            bytes.copy_from_slice(part);
            rest = left;
        }
        self.spread();
    }
}

/// From `a` at 0 to `b` at 1.
fn mixed(a: [f32; 4], b: [f32; 4], part: f32) -> [f32; 4] {
    std::array::from_fn(|c| a[c] + part * (b[c] - a[c]))
}

/// Where the centres of the scene's cells lie along one axis, among those of the box around the coarser body.
fn between(lattice: &Lattice, coarse: &Lattice, axis: usize) -> Vec<(u32, f32)> {
    // Centres of cells are half a cell from their corners, and the box begins one cell before the body.
    let per_cell = lattice.spacing_m / coarse.spacing_m;
    let place = |c: usize| (c as f64 + 0.5) * per_cell + 0.5;
    let cell = |place: f64| (place as u32).min(coarse.dims[axis] as u32);
    let found = (0..lattice.dims[axis]).map(|c| (cell(place(c)), place(c)));
    found
        .map(|(cell, place)| (cell, (place - f64::from(cell)).clamp(0.0, 1.0) as f32))
        .collect()
}

/// The element of a cell of the box, or else one of a neighbouring cell: first over faces, then edges, then corners.
fn nearest(coarse: &Lattice, cell: [usize; 3]) -> u32 {
    let mut steps: Vec<[i64; 3]> = (0..27).map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1]).collect();
    steps.sort_by_key(|step| step.iter().map(|c| c.abs()).sum::<i64>());
    let element = |step: &[i64; 3]| {
        let [i, j, k] = [0, 1, 2].map(|a| usize::try_from(cell[a] as i64 - 1 + step[a]).ok());
        coarse.element_of_cell(i?, j?, k?)
    };
    steps.iter().find_map(element).unwrap_or(NONE)
}

#[cfg(test)]
mod tests;
