//! State of the elastic body as bytes, for flight recordings. On a needle line, and at rest, there is no more to it.

use super::real::Real;
use super::state::FemState;
use crate::tissue::parts;
use bytemuck::{bytes_of, bytes_of_mut, cast_slice, cast_slice_mut};

impl<T: Real> FemState<T> {
    fn memory(&self) -> [&[u8]; 4] {
        let [x, y, z] = &self.displacement;
        [
            cast_slice(x),
            cast_slice(y),
            cast_slice(z),
            bytes_of(&self.max_displacement),
        ]
    }

    pub(super) fn memory_len(&self) -> usize {
        parts::len(&self.memory())
    }

    pub(super) fn save(&self, to: &mut [u8]) {
        parts::save(&self.memory(), to);
    }

    /// Loads a state and forgets what is held.
    pub(super) fn load(&mut self, from: &[u8]) {
        let largest = bytes_of_mut(&mut self.max_displacement);
        let [x, y, z] = self.displacement.each_mut().map(|axis| cast_slice_mut(axis));
        if parts::load(&mut [x, y, z, largest], from) {
            self.forget();
        }
    }
}
