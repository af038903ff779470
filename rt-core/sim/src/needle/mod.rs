//! The needle and what it does to the tissue it holds.

pub mod layers;
pub mod path;
pub mod phase;

pub use layers::{LAYER_COUNT, Layer, LayerKind, Layers};
pub use path::{Front, NeedlePath, Section};
pub use phase::{NeedleInput, NeedleOutput, NeedleParameters, NeedleState, Phase, step, transmission};
