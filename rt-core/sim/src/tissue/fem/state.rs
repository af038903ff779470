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
