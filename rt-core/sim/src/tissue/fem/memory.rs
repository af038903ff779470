//! Where the elastic body is, as bytes: for flight recordings. On a needle line, and at rest, there is no more to it.

use super::real::Real;
use super::state::FemState;
use bytemuck::{bytes_of, bytes_of_mut, cast_slice, cast_slice_mut};

impl<T: Real> FemState<T> {
    pub(super) fn memory_len(&self) -> usize {
        size_of_val(&self.max_displacement)
            + self
                .displacement
                .iter()
                .map(|u| size_of_val(u.as_slice()))
                .sum::<usize>()
    }

    pub(super) fn save(&self, to: &mut [u8]) {
        if to.len() != self.memory_len() {
            return;
        }
        let [x, y, z] = &self.displacement;
        let parts = [
            cast_slice(x),
            cast_slice(y),
            cast_slice(z),
            bytes_of(&self.max_displacement),
        ];
        let mut rest = to;
        for part in parts {
            let (here, after) = rest.split_at_mut(part.len());
            here.copy_from_slice(part);
            rest = after;
        }
    }

    /// What is held is forgotten.
    pub(super) fn load(&mut self, from: &[u8]) {
        if from.len() != self.memory_len() {
            return;
        }
        self.forget();
        let [x, y, z] = &mut self.displacement;
        let parts = [
            cast_slice_mut(x),
            cast_slice_mut(y),
            cast_slice_mut(z),
            bytes_of_mut(&mut self.max_displacement),
        ];
        let mut rest = from;
        for part in parts {
            let (here, after) = rest.split_at(part.len());
            part.copy_from_slice(here);
            rest = after;
        }
    }
}
