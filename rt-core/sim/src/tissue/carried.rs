//! Displacement of the whole body on top of a model's own steps.

use super::field::{add_fields, add_up};
use super::{ElementField, LargeStrain, PackedField, parts};
use crate::scene::{Lattice, Scene};
use crate::simd::Simd;
use std::ops::Range;
use std::sync::Arc;

/// Displacement of a part of a body as one piece, on its foundation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shift<'a> {
    /// Displacement, m.
    pub by_m: [f64; 3],
    /// Elements of the part.
    pub elements: &'a [Range<u32>],
}

impl Shift<'_> {
    /// Makes a displacement of a body that is all of one piece.
    pub fn of_all(by_m: [f64; 3]) -> Self {
        const ALL: Range<u32> = 0..u32::MAX;
        Shift { by_m, elements: &[ALL] }
    }

    /// Adds it to a field in units of so many per metre.
    pub(super) fn add_to(&self, per_m: f64, field: &mut [Vec<f32>; 3]) {
        for (axis, by_m) in field.iter_mut().zip(self.by_m) {
            // Most often there is none.
            if by_m != 0.0 {
                let by = (by_m * per_m) as f32;
                for elements in self.elements {
                    let (first, end) = (elements.start as usize, axis.len().min(elements.end as usize));
                    let part = axis.get_mut(first..end);
                    part.into_iter().flatten().for_each(|u| *u += by);
                }
            }
        }
    }
}

/// Motion that carries a body from now on: the answer of a coarser body to the loads of needles.
#[derive(Clone, Copy, Debug, Default)]
pub struct Carry<'a> {
    /// Displacement of every element of that body, m/N, and the load of each, N.
    pub columns: &'a [PackedField],
    /// Loads, as many as there are columns; a column without a load counts as 0.
    pub loads_n: &'a [f64],
    /// Further displacements of that body, m.
    pub fields: &'a [&'a ElementField],
    /// Displacement of the part that is loaded, on top.
    pub shift: Shift<'a>,
}

impl Carry<'_> {
    /// No motion.
    pub const NOT: Self = Carry {
        columns: &[],
        loads_n: &[],
        fields: &[],
        shift: Shift {
            by_m: [0.0; 3],
            elements: &[],
        },
    };

    fn is_at_rest(&self) -> bool {
        let is_loaded = !self.columns.is_empty() && self.loads_n.iter().any(|n| *n != 0.0);
        !is_loaded && self.fields.is_empty() && self.shift.by_m == [0.0; 3]
    }
}

/// Motion that carries a body.
#[derive(Clone, Copy, Debug, Default)]
pub enum Carried<'a> {
    /// No motion.
    #[default]
    Not,
    /// Field of a coarser body.
    Field(&'a CarriedField),
    /// Field of a coarser body, and near the tip the correction where it folds.
    Unfolded(&'a CarriedField, &'a LargeStrain),
}

impl Carried<'_> {
    /// Returns the displacement of an element, m.
    pub fn at_m(&self, lattice: &Lattice, element: u32) -> [f64; 3] {
        match self {
            Self::Not => [0.0; 3],
            Self::Field(field) => field.at_m(lattice, element),
            Self::Unfolded(field, near_tip) => {
                let (field_m, moved) = (field.at_m(lattice, element), near_tip.at(lattice, element));
                [0, 1, 2].map(|a| field_m[a] + lattice.spacing_m * f64::from(moved[a]))
            }
        }
    }

    /// Returns a bound of the displacement of every element, m; the body's elements have that spacing.
    pub fn largest_m(&self, spacing_m: f64) -> f64 {
        match self {
            Self::Not => 0.0,
            Self::Field(field) => f64::from(field.largest_m),
            Self::Unfolded(field, near_tip) => {
                let moved = f64::from(near_tip.farthest()) * 3.0_f64.sqrt();
                f64::from(field.largest_m) + spacing_m * moved
            }
        }
    }
}

/// Displacements of a coarser body's elements, between whose centres they are interpolated. What is fixed stays.
#[derive(Clone, Debug)]
pub struct CarriedField {
    simd: Simd,
    /// Displacement of each element of the coarser body, m.
    of_element: [Vec<f32>; 3],
    /// The same at each cell of a box with one empty cell around the body: what is next to the body moves with it. The
    /// fourth number is empty, so that a cell is one register.
    of_cell_m: Vec<[f32; 4]>,
    /// Cells of the box that take their displacement from an element, with that element: a body may fill little of its
    /// box.
    source: Vec<[u32; 2]>,
    /// Cells of the box along x, y, z.
    dims: [usize; 3],
    /// Places of the scene's cell centres along x, y, z: the cell of the box before each, and the part of the way to
    /// the next.
    between: [Vec<(u32, f32)>; 3],
    /// Fixed structures.
    is_fixed: Vec<bool>,
    largest_m: f32,
}

impl CarriedField {
    /// Makes a field at rest; `coarse` is a coarser lattice of the scene's cells.
    pub fn new(scene: &Scene, coarse: Arc<Lattice>) -> Self {
        let dims = coarse.dims.map(|n| n + 2);
        let cells = dims.iter().product::<usize>();
        let cell = |at: usize| [at % dims[0], at / dims[0] % dims[1], at / dims[0] / dims[1]];
        let (steps, is_full) = (steps_outward(), mostly_full(&scene.lattice, &coarse));
        let source = (0..cells).filter_map(|at| Some([at as u32, nearest(&coarse, cell(at), &steps, &is_full)?]));
        CarriedField {
            simd: Simd::detect(),
            between: [0, 1, 2].map(|a| between(&scene.lattice, &coarse, a)),
            of_element: std::array::from_fn(|_| vec![0.0; coarse.element_count()]),
            of_cell_m: vec![[0.0; 4]; cells],
            source: source.collect(),
            dims,
            is_fixed: scene.structures.iter().map(|s| s.material.fixed).collect(),
            largest_m: 0.0,
        }
    }

    /// Sets the field to the sum of loads times answers, fields and a shift; does not allocate.
    pub fn set(&mut self, by: Carry<'_>) {
        if by.is_at_rest() {
            return self.clear();
        }
        add_up(self.simd, by.columns, by.loads_n, 1.0, &mut self.of_element);
        add_fields(by.fields, 1.0, &mut self.of_element);
        by.shift.add_to(1.0, &mut self.of_element);
        self.spread();
    }

    fn clear(&mut self) {
        if !self.is_at_rest() {
            self.of_element.iter_mut().for_each(|axis| axis.fill(0.0));
            self.spread();
        }
    }

    /// Returns whether it displaces nothing.
    pub fn is_at_rest(&self) -> bool {
        self.largest_m == 0.0
    }

    fn spread(&mut self) {
        let [x, y, z] = &self.of_element;
        let mut largest = 0.0_f32;
        for &[cell, element] in &self.source {
            let at = |axis: &Vec<f32>| axis.get(element as usize).copied().unwrap_or(0.0);
            let moved_m = [at(x), at(y), at(z), 0.0];
            if let Some(slot) = self.of_cell_m.get_mut(cell as usize) {
                *slot = moved_m;
            }
            let square = moved_m.iter().map(|c| c * c).sum::<f32>();
            // NaN stays, so that no reader mistakes the answer for a number.
            largest = if square <= largest { largest } else { square };
        }
        self.largest_m = largest.sqrt();
    }

    /// Returns the displacement of an element of the scene's lattice, m.
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

    fn memory(&self) -> [&[u8]; 3] {
        self.of_element.each_ref().map(|axis| bytemuck::cast_slice(axis))
    }

    /// Returns the size of [`Self::save`], in bytes.
    pub fn memory_len(&self) -> usize {
        parts::len(&self.memory())
    }

    /// Writes what the next tick needs; nothing where `to` has another length.
    pub fn save(&self, to: &mut [u8]) {
        parts::save(&self.memory(), to);
    }

    /// Loads what another field of the same body saved; nothing where `from` has another length.
    pub fn load(&mut self, from: &[u8]) {
        let mut axes = self.of_element.each_mut().map(|axis| bytemuck::cast_slice_mut(axis));
        if parts::load(&mut axes, from) {
            self.spread();
        }
    }
}

/// Interpolates from `a` at 0 to `b` at 1.
fn mixed(a: [f32; 4], b: [f32; 4], part: f32) -> [f32; 4] {
    std::array::from_fn(|c| a[c] + part * (b[c] - a[c]))
}

/// Returns the places of the scene's cell centres along one axis, among those of the box around the coarser body.
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

/// Returns the element of a cell of the box, or else of one of the neighbouring cells, in the order of `steps`. It
/// prefers one that is mostly full: another is as soft as it is empty, and at the rim moves farther than the tissue in
/// it.
fn nearest(coarse: &Lattice, cell: [usize; 3], steps: &[[i64; 3]; 27], is_full: &[bool]) -> Option<u32> {
    let element = |step: &[i64; 3]| {
        let [i, j, k] = [0, 1, 2].map(|a| usize::try_from(cell[a] as i64 - 1 + step[a]).ok());
        coarse.element_of_cell(i?, j?, k?)
    };
    let full = |e: &u32| is_full.get(*e as usize).copied().unwrap_or(false);
    let mut around = steps.iter().filter_map(element);
    let first = around.next()?;
    if full(&first) {
        return Some(first);
    }
    around.find(full).or(Some(first))
}

/// Returns for each element of the coarser body whether more than half of it is cells of the scene.
fn mostly_full(lattice: &Lattice, coarse: &Lattice) -> Vec<bool> {
    let per_edge = (coarse.spacing_m / lattice.spacing_m).round().max(1.0) as usize;
    let mut cells = vec![0_usize; coarse.element_count()];
    for element in 0..lattice.element_count() as u32 {
        let [i, j, k] = lattice.cell(element).map(|c| c / per_edge);
        if let Some(of) = coarse.element_of_cell(i, j, k)
            && let Some(count) = cells.get_mut(of as usize)
        {
            *count += 1;
        }
    }
    cells.into_iter().map(|count| 2 * count > per_edge.pow(3)).collect()
}

/// Returns the steps to the cell itself, then over its faces, edges and corners.
fn steps_outward() -> [[i64; 3]; 27] {
    let mut steps = std::array::from_fn(|n| n as i64).map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1]);
    steps.sort_by_key(|step: &[i64; 3]| step.iter().map(|c| c.abs()).sum::<i64>());
    steps
}

#[cfg(test)]
mod tests;
