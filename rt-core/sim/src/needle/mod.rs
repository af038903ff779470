//! The needle, and its grip on the tissue around the tip.

// What the lists of clippy.toml name has no place in a tick; tests may.
#![cfg_attr(
    not(test),
    deny(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types)
)]

pub mod layers;
pub mod path;
pub mod phase;

pub use layers::{LAYER_COUNT, Layer, LayerKind, Layers};
pub use path::{Front, NeedlePath, Section};
pub use phase::{NeedleInput, NeedleOutput, NeedleParameters, NeedleState, Phase, step, transmission};
