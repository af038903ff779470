//! Files that a user brings.

mod affine;
pub mod nifti;
mod volume;

pub use nifti::{FileError, read};
pub use volume::LabelVolume;
