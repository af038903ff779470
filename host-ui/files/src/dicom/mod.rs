//! DICOM of radiotherapy: structure sets and their images as label volumes, brachytherapy plans, dose grids.

use crate::error::ContentError;

mod agree;
mod charset;
mod checked;
mod compressed;
pub mod dose;
mod identity;
pub mod images;
mod parse;
mod pixels;
pub mod plan;
pub mod segmentation;
pub mod series;
pub mod structures;
mod values;
mod walk;
mod write;

pub use agree::{Agreed, Shared, agree};
pub use checked::{Object, is_dicom, read, read_head};
pub use identity::Identity;
pub use write::new_uid;

/// SOP class of an RT Dose.
pub const RT_DOSE: &str = dicom_dictionary_std::uids::RT_DOSE_STORAGE;
/// SOP class of a Segmentation.
pub const SEGMENTATION: &str = dicom_dictionary_std::uids::SEGMENTATION_STORAGE;
/// SOP class of an RT Plan.
pub const RT_PLAN: &str = dicom_dictionary_std::uids::RT_PLAN_STORAGE;

/// Reads a file of labels: a segmentation, or a structure set on the images in its folder.
pub fn labels(bytes: &[u8], folder: &std::path::Path) -> Result<crate::Voxels, ContentError> {
    match drawn(bytes)? {
        Some(object) => structures::read(&object, folder),
        None => segmentation::read(bytes),
    }
}

/// Returns the object of structures that are drawn as contours; `None` for a segmentation and for
/// formats other than DICOM, which have them as labels.
pub fn drawn(bytes: &[u8]) -> Result<Option<Object>, ContentError> {
    if !is_dicom(bytes) {
        return Ok(None);
    }
    let object = read(bytes)?;
    Ok((!segmentation::is_segmentation(&object.sop_class)).then_some(object))
}

/// Checks the frame of an image series made of one file twice, one slice apart, to test the reader
/// alone.
pub fn image_geometry(bytes: &[u8]) -> Result<(), ContentError> {
    let Some(read) = checked::read(bytes).ok().and_then(|object| images::slice(&object)) else {
        return Ok(());
    };
    let slice = read?;
    images::grid(vec![slice.clone(), slice]).map(|_| ())
}

#[cfg(test)]
mod tests;
