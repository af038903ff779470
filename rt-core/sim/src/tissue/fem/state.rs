//! State of the elastic body, with the work space of a step.

use super::grip::Grip;
use super::model::FemModel;
use super::real::Real;
use super::sweep::touched;
use crate::tissue::{ElementField, PackedField, Shift, add_fields, add_up};

/// Displacements of all elements, and what the solver keeps from tick to tick.
#[derive(Clone, Debug)]
pub struct FemState<T = f32> {
    /// Displacement of the element centres, in elements.
    pub(super) displacement: [Vec<f32>; 3],
    pub(super) max_displacement: f32,
    /// Grip on the held patch.
    pub(super) grip: Grip<T>,
    /// Grip on the patch that is prepared, or on the one held before.
    pub(super) next: Grip<T>,
    /// The last step took no cycle, and nothing has been prepared since.
    pub(super) has_time: bool,
}

impl<T: Real> FemState<T> {
    /// Returns the body at rest.
    pub fn at_rest(model: &FemModel<T>) -> Self {
        FemState {
            displacement: std::array::from_fn(|_| touched(model.element_count(), 0.0)),
            max_displacement: 0.0,
            grip: Grip::new(model),
            next: Grip::new(model),
            has_time: false,
        }
    }

    /// Returns the displacement from rest along `axis` (0 to 2) of the centres of all elements, in elements.
    pub fn displacement(&self, axis: usize) -> &[f32] {
        self.displacement.get(axis).map_or(&[], Vec::as_slice)
    }

    /// Returns the elastic energy, in body and springs.
    #[cfg(test)]
    pub fn strain_energy_j(&mut self, model: &FemModel<T>) -> f64 {
        self.grip.strain_energy_j(model)
    }

    /// Returns the displacement of the node at `corner`, counted in cells from the scene's origin, in metres; `None`
    /// without a node.
    #[cfg(test)]
    pub fn node_displacement_m(&self, model: &FemModel<T>, corner: [usize; 3]) -> Option<[f64; 3]> {
        let grid = &model.levels[0].grid;
        let mut place = [0; 3];
        for axis in 0..3 {
            place[axis] = corner[axis].checked_sub(model.low_cell[axis])?;
            if place[axis] >= grid.nodes[axis] {
                return None;
            }
        }
        let node = grid.index(place);
        (model.part[node] != u32::MAX).then(|| {
            [0, 1, 2].map(|a| {
                self.grip
                    .used()
                    .iter()
                    .map(|r| r.weight_m * r.u[a][node].to_f64())
                    .sum()
            })
        })
    }

    /// Lets loose and forgets what is held, and displaces every element by the sum of loads times answers (m/N) and by
    /// `shift`; how many moved.
    pub fn displace(&mut self, model: &FemModel<T>, columns: &[PackedField], loads_n: &[f64], shift: Shift<'_>) -> u32 {
        if !self.fits(model) {
            return 0;
        }
        // A line's body owes nothing to what was held before: what comes after repeats without it.
        self.forget();
        self.has_time = false;
        let (simd, per_element) = (model.levels[0].simd, 1.0 / model.lattice.spacing_m);
        add_up(simd, columns, loads_n, per_element, &mut self.displacement);
        shift.add_to(per_element, &mut self.displacement);
        self.measure()
    }

    /// Displaces every element by these fields as well, m; how many are displaced.
    pub fn add(&mut self, model: &FemModel<T>, fields: &[&ElementField]) -> u32 {
        let per_element = (1.0 / model.lattice.spacing_m) as f32;
        add_fields(fields, per_element, &mut self.displacement);
        self.measure()
    }

    /// Finds the largest displacement; returns how many elements are displaced.
    fn measure(&mut self) -> u32 {
        let [x, y, z] = &self.displacement;
        let (mut largest, mut moved) = (0.0_f32, 0);
        for ((x, y), z) in x.iter().zip(y).zip(z) {
            let square = x * x + y * y + z * z;
            moved += u32::from(square > 0.0);
            // NaN stays, so that no reader mistakes the answer for a number.
            largest = if square <= largest { largest } else { square };
        }
        self.max_displacement = largest.sqrt();
        moved
    }

    /// Returns whether no answer is kept: steps from here on depend on nothing that came before.
    pub(super) fn has_forgotten(&self) -> bool {
        self.grip.cells.is_none() && self.next.cells.is_none()
    }

    /// Drops the answers that are kept: steps from here on give the same bytes as those of a new state.
    pub(super) fn forget(&mut self) {
        self.grip.drop_patch();
        self.next.drop_patch();
    }

    pub(super) fn fits(&self, model: &FemModel<T>) -> bool {
        let grips = [&self.grip, &self.next];
        grips.into_iter().all(|grip| grip.fits(model)) && self.displacement[0].len() == model.element_count()
    }
}
