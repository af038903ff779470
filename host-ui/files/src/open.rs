//! The format of a file, by its content; the formats' own readers do the rest.

use super::bytes::{data_file, folder, whole};
use super::element::Sink;
use super::error::{ContentError, FileError, invalid};
use super::progress::Progress;
use super::volume::Voxels;
use super::{dicom, metaimage, nifti, nrrd};
use std::collections::BTreeMap;
use std::path::Path;

/// Formats of label volumes, for display.
pub const FORMATS: &str = "NIfTI-1 (.nii, .nii.gz), NRRD (.nrrd, .nhdr, .seg.nrrd), MetaImage (.mha, .mhd), \
     DICOM RT Structure Set and Segmentation (.dcm)";

/// Content of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// DICOM, with or without a preamble.
    Dicom,
    /// NRRD.
    Nrrd,
    /// NIfTI-1, packed or not.
    Nifti,
    /// MetaImage.
    MetaImage,
}

impl Format {
    /// Detects the format by the first bytes, whatever the name; each format has a function that recognises them.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        type Test = fn(&[u8]) -> bool;
        let tests: [(Self, Test); 4] = [
            (Self::Dicom, dicom::is_dicom),
            (Self::Nrrd, nrrd::is_nrrd),
            (Self::Nifti, nifti::is_nifti),
            (Self::MetaImage, metaimage::is_metaimage),
        ];
        tests.into_iter().find(|(_, is)| is(bytes)).map(|(format, _)| format)
    }
}

/// Reads the labels as they are stored in the file.
pub fn read_voxels(path: &Path, progress: &Progress) -> Result<Voxels, FileError> {
    let refused = |why: ContentError| FileError::of(path, why);
    let bytes = whole(path, progress).map_err(refused)?;
    let sink = Sink::labels(progress);
    let data = |name: &str| data_file(path, name, progress);
    let voxels = match Format::of(&bytes) {
        Some(Format::Dicom) => dicom::labels(&bytes, folder(path)),
        Some(Format::Nrrd) => nrrd::read(&bytes, &data, sink),
        Some(Format::Nifti) => nifti::read(&bytes, sink).map(|v| v.named(BTreeMap::new())),
        Some(Format::MetaImage) => metaimage::read(&bytes, &data, sink).map(|v| v.named(BTreeMap::new())),
        None => Err(invalid!(
            "its format is not supported; supported are {FORMATS}; export the segmentation as one of them"
        )),
    };
    voxels.map_err(refused)
}
