//! Files that a user brings: label volumes of any format as the same voxels. Nothing that a header says is believed.

mod affine;
pub mod convert;
pub mod dicom;
pub mod element;
pub mod error;
mod frame;
pub mod image;
pub mod metaimage;
pub mod names;
pub mod nifti;
pub mod nrrd;
pub mod open;
mod overlap;
mod progress;
pub mod scene;
mod volume;

pub use element::Sink;
pub use error::FileError;
pub use frame::{VoxelFrame, ras_from_lps};
pub use image::Image;
pub use open::{read, read_voxels};
pub use progress::{Progress, Stage};
pub use volume::{LabelVolume, Tissue, VoxelValues, Voxels};

/// Reads the file that a header names as that of its data.
pub type Beside<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, String>;
