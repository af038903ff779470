//! Files of a user: label volumes of any format as the same voxels. Every value of a header is
//! checked before it is used.
#![warn(missing_docs)]

mod affine;
pub mod bytes;
mod carried;
pub mod convert;
pub mod dicom;
pub mod element;
pub mod error;
mod frame;
pub mod image;
mod load;
pub mod metaimage;
pub mod nifti;
pub mod nrrd;
pub mod open;
mod overlap;
mod progress;
mod report;
pub mod scene;
mod volume;
mod watched;

pub use carried::{agreed, lines_of, together};
pub use element::Sink;
pub use error::{ContentError, FileError};
pub use frame::VoxelFrame;
pub use image::Image;
pub use load::read;
pub use open::read_voxels;
pub use progress::{Progress, Stage};
pub use report::report;
pub use volume::{LabelVolume, Tissue, VoxelValues, Voxels, role_and_material, voxels_per_label};
pub use watched::watched;

/// Reader of the data file that a header names.
pub type DataReader<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, ContentError>;
