//! The needle and what it does to the tissue it holds.

pub mod phase;

pub use phase::{NeedleInput, NeedleOutput, NeedleParameters, NeedleState, Phase, step, transmission};
