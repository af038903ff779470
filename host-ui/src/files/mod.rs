//! Files that a user brings.

mod affine;
pub mod nifti;
mod volume;

pub use affine::VoxelFrame;
pub use nifti::{FileError, read, read_voxels};
pub use volume::{LabelVolume, Voxels};
