//! Files that a user brings.

mod affine;
mod nifti;
mod volume;

pub use nifti::{FileError, read};
pub use volume::LabelVolume;
