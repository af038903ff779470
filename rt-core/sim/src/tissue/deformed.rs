//! The body as it is now: what everything but the models reads.

use super::Carried;
use crate::scene::{Lattice, Surface};

/// A lattice and the displacement of each of its elements.
#[derive(Clone, Copy)]
pub struct Deformed<'a> {
    /// Elements and their neighbours.
    pub lattice: &'a Lattice,
    /// Along x, y, z; `scale` times these is in elements.
    pub u: [&'a [f32]; 3],
    /// Elements for each unit of `u`.
    pub scale: f32,
    /// A displacement of the whole body, on top of that.
    pub carried: Carried<'a>,
    /// No corner of an element is farther from the element's box at rest, in elements.
    pub reach: f32,
}

impl Deformed<'_> {
    /// Displacement from rest of one element, in elements; the last element's for a number past the end.
    pub fn displacement(&self, element: u32) -> [f64; 3] {
        let u = self.not_carried(element);
        if matches!(self.carried, Carried::Not) {
            return u;
        }
        let e = (element as usize).min(self.lattice.element_count().saturating_sub(1));
        let carried_m = self.carried.at_m(self.lattice, e as u32);
        [0, 1, 2].map(|a| u[a] + carried_m[a] / self.lattice.spacing_m)
    }

    /// Without what carries the whole body: loops over a body that nothing carries look for that once.
    #[inline(always)]
    pub(super) fn not_carried(&self, element: u32) -> [f64; 3] {
        let e = (element as usize).min(self.lattice.element_count().saturating_sub(1));
        self.u.map(|c| c.get(e).map_or(0.0, |u| f64::from(self.scale * u)))
    }

    /// Centre of an element in the scene frame; the last element's for a number past the end.
    pub fn position_m(&self, element: u32) -> [f64; 3] {
        let rest = self.lattice.rest_m(element);
        let u = self.displacement(element);
        [0, 1, 2].map(|a| rest[a] + self.lattice.spacing_m * u[a])
    }

    /// Writes the displacements of elements in metres; stops at the shorter of the two.
    pub fn write_displacements(&self, elements: &[u32], displacements_m: &mut [[f32; 3]]) {
        for (slot, &element) in displacements_m.iter_mut().zip(elements) {
            *slot = self.displacement(element).map(|u| (self.lattice.spacing_m * u) as f32);
        }
    }

    /// Writes the positions of the surface's vertices in metres; stops at the shorter of the two. `at_rest` is the lattice that
    /// the surface was cut from.
    pub fn write_surface(&self, at_rest: &Lattice, surface: &Surface, positions_m: &mut [[f32; 3]]) {
        let vertices = surface.vertex_elements.iter();
        if surface.moved_by.is_empty() {
            let place_m = |element: u32, u: [f64; 3]| {
                let rest = self.lattice.rest_m(element);
                [0, 1, 2].map(|a| (rest[a] + self.lattice.spacing_m * u[a]) as f32)
            };
            let slots = positions_m.iter_mut().zip(vertices);
            match self.carried {
                Carried::Not => slots.for_each(|(slot, &e)| *slot = place_m(e, self.not_carried(e))),
                _ => slots.for_each(|(slot, &e)| *slot = place_m(e, self.displacement(e))),
            }
            return;
        }
        for ((slot, &element), &moved_by) in positions_m.iter_mut().zip(vertices).zip(&surface.moved_by) {
            let (rest_m, u) = (at_rest.rest_m(element), self.displacement(moved_by));
            *slot = [0, 1, 2].map(|a| (rest_m[a] + self.lattice.spacing_m * u[a]) as f32);
        }
    }
}
