//! Files that a user brings.

mod volume;

pub use volume::LabelVolume;
