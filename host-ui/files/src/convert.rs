//! Conversion of label volumes, by the name of the output file.

use super::bytes::file_name;
use super::dicom::Identity;
use super::error::{ContentError, FileError};
use super::volume::Voxels;
use super::{metaimage, nifti, nrrd};
use std::path::Path;

/// Writer of a label volume.
type Writer = fn(&Voxels, Option<&Identity>) -> Result<Vec<u8>, ContentError>;

fn writer(path: &Path) -> Option<Writer> {
    let name = file_name(path).to_ascii_lowercase();
    let ends = |e: &str| name.ends_with(e);
    if ends(".nrrd") {
        Some(nrrd::write::bytes)
    } else if ends(".mha") {
        Some(|v, _| metaimage::write::bytes(v))
    } else if ends(".nii.gz") {
        Some(|v, _| nifti::write::bytes(v))
    } else {
        None
    }
}

/// Returns whether a label volume can be written under that name.
pub fn can_hold_labels(path: &Path) -> bool {
    writer(path).is_some()
}

/// Writes a label volume in the format that the file's name selects; only NRRD keeps the identity.
pub fn write_labels(v: &Voxels, path: &Path, identity: Option<&Identity>) -> Result<(), FileError> {
    let refused = |why: ContentError| FileError::of(path, why);
    let writer =
        writer(path).ok_or_else(|| refused("label volumes are written as .nrrd, .seg.nrrd, .mha or .nii.gz".into()))?;
    stylet_base::write_whole(path, &writer(v, identity).map_err(refused)?)
        .map_err(|e| refused(ContentError::Unwritable(e.source.to_string())))
}
