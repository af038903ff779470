//! The deformed body, which everything but the models reads.

use super::Carried;
use crate::scene::{Lattice, Surface};

/// A lattice and the displacement of each of its elements.
#[derive(Clone, Copy)]
pub struct Deformed<'a> {
    /// Elements and their neighbours.
    pub lattice: &'a Lattice,
    /// Displacement along x, y, z; `scale` times these is in elements.
    pub u: [&'a [f32]; 3],
    /// Elements for each unit of `u`.
    pub scale: f32,
    /// A displacement of the whole body, on top of that.
    pub carried: Carried<'a>,
    /// Largest distance of an element's corner from the element's box at rest, in elements.
    pub reach: f32,
}

impl Deformed<'_> {
    /// Returns the displacement from rest of one element, in elements; the last element's for a number past the end.
    pub fn displacement(&self, element: u32) -> [f64; 3] {
        let u = self.not_carried(element);
        if matches!(self.carried, Carried::Not) {
            return u;
        }
        let e = (element as usize).min(self.lattice.element_count().saturating_sub(1));
        let carried_m = self.carried.at_m(self.lattice, e as u32);
        [0, 1, 2].map(|a| u[a] + carried_m[a] / self.lattice.spacing_m)
    }

    /// Returns the displacement without the motion that carries the whole body: loops over a body that nothing carries
    /// check for that once.
    #[inline(always)]
    pub(super) fn not_carried(&self, element: u32) -> [f64; 3] {
        let e = (element as usize).min(self.lattice.element_count().saturating_sub(1));
        self.u.map(|c| c.get(e).map_or(0.0, |u| f64::from(self.scale * u)))
    }

    /// Returns the centre of an element in the scene frame; the last element's for a number past the end.
    pub fn position_m(&self, element: u32) -> [f64; 3] {
        let rest = self.lattice.rest_m(element);
        let u = self.displacement(element);
        [0, 1, 2].map(|a| rest[a] + self.lattice.spacing_m * u[a])
    }

    /// Writes the displacements of elements in metres; stops at the shorter of the two.
    pub fn write_displacements(&self, elements: &[u32], displacements_m: &mut [[f32; 3]]) {
        self.for_each(elements, displacements_m, |slot, moved_m, _| *slot = moved_m);
    }

    /// Writes the positions of the surface's vertices in metres; stops at the shorter of the two.
    pub fn write_surface(&self, surface: &Surface, positions_m: &mut [[f32; 3]]) {
        let elements = match surface.moved_by.is_empty() {
            true => &surface.vertex_elements,
            false => &surface.moved_by,
        };
        let count = positions_m.len().min(surface.rest_m.len());
        let (positions_m, rest_m) = (&mut positions_m[..count], &surface.rest_m[..count]);
        self.for_each(elements, positions_m, |slot, moved_m, n| {
            *slot = [0, 1, 2].map(|a| rest_m[n][a] + moved_m[a]);
        });
    }

    /// Gives `put` each slot, the displacement of its element in metres, and its number.
    #[inline(always)]
    fn for_each(&self, elements: &[u32], slots: &mut [[f32; 3]], mut put: impl FnMut(&mut [f32; 3], [f32; 3], usize)) {
        let slots = slots.iter_mut().zip(elements).enumerate();
        if matches!(self.carried, Carried::Not) {
            let unit_m = self.lattice.spacing_m as f32 * self.scale;
            let moved_m = |e: u32| self.u.map(|c| c.get(e as usize).map_or(0.0, |u| unit_m * u));
            return slots.for_each(|(n, (slot, &element))| put(slot, moved_m(element), n));
        }
        for (n, (slot, &element)) in slots {
            let u = self.displacement(element);
            put(slot, u.map(|u| (self.lattice.spacing_m * u) as f32), n);
        }
    }
}
