//! State that a window leaves to the next tick, as bytes.

use super::LargeStrain;
use crate::tissue::parts;
use bytemuck::{bytes_of, bytes_of_mut, cast_slice, cast_slice_mut};

impl LargeStrain {
    fn memory(&self) -> [&[u8]; 9] {
        let [x, y, z] = self.off.each_ref().map(|axis| cast_slice(axis));
        let [a, b, c] = self.moved.each_ref().map(|axis| cast_slice(axis));
        let (part, farthest) = (bytes_of(&self.part), bytes_of(&self.farthest));
        [bytes_of(&self.around), part, farthest, x, y, z, a, b, c]
    }

    /// Returns the size of [`Self::save`], in bytes.
    pub fn memory_len(&self) -> usize {
        parts::len(&self.memory())
    }

    /// Writes what the next tick needs; nothing where `to` has another length.
    pub fn save(&self, to: &mut [u8]) {
        parts::save(&self.memory(), to);
    }

    /// Loads what another window of the same body saved; nothing where `from` has another length.
    pub fn load(&mut self, from: &[u8]) {
        let [x, y, z] = self.off.each_mut().map(|axis| cast_slice_mut(axis));
        let [a, b, c] = self.moved.each_mut().map(|axis| cast_slice_mut(axis));
        let (part, farthest) = (bytes_of_mut(&mut self.part), bytes_of_mut(&mut self.farthest));
        let around = bytes_of_mut(&mut self.around);
        parts::load(&mut [around, part, farthest, x, y, z, a, b, c], from);
    }
}
