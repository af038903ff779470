//! Label volumes from one format to another, by the name of the file to be written.

use super::volume::Voxels;
use super::{metaimage, nifti, nrrd};
use std::path::Path;

/// Ways to write a label volume.
type Writer = fn(&Voxels) -> Result<Vec<u8>, String>;

fn writer(path: &Path) -> Option<Writer> {
    let name = super::open::file_name(path).to_ascii_lowercase();
    let ends = |e: &str| name.ends_with(e);
    if ends(".nrrd") {
        Some(nrrd::write::bytes)
    } else if ends(".mha") {
        Some(metaimage::write::bytes)
    } else if ends(".nii.gz") {
        Some(nifti::write::bytes)
    } else {
        None
    }
}

pub fn can_hold_labels(path: &Path) -> bool {
    writer(path).is_some()
}

pub fn write_labels(v: &Voxels, path: &Path) -> Result<(), String> {
    let Some(writer) = writer(path) else {
        return Err(format!(
            "{}: label volumes are written as .nrrd, .seg.nrrd, .mha or .nii.gz",
            path.display()
        ));
    };
    stylet_base::write_whole(path, &writer(v)?).map_err(|e| e.to_string())
}
