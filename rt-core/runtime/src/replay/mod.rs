//! Flight recordings, written and read again.
//!
//! A flight recording holds a checkpoint and every input after it; the loops are then run again by the same code,
//! and their outputs are compared with what was recorded, bit by bit.

pub mod file;
pub mod lines;
pub mod repeat;
pub mod second;

#[cfg(test)]
mod tests;
