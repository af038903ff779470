//! Which format a file has, by what is in it; the formats' own readers do the rest.

use super::element::Sink;
use super::error::FileError;
use super::progress::{Progress, Stage};
use super::volume::{LabelVolume, Voxels};
use super::{dicom, metaimage, nifti, nrrd, scene};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path};

/// Larger than any segmentation of a pelvis.
const MAX_FILE_BYTES: u64 = 1 << 30;
/// Read between two words of how far it is.
const PART_BYTES: u64 = 1 << 23;
pub const FORMATS: &str =
    "NIfTI-1 (.nii, .nii.gz), NRRD (.nrrd, .nhdr, .seg.nrrd), MetaImage (.mha, .mhd), DICOM RT Structure Set (.dcm)";

/// What is in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Dicom,
    Nrrd,
    Nifti,
    MetaImage,
}

impl Format {
    /// By its first bytes, whatever its name.
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

/// The tissue of a label volume: its structures where it names them, otherwise every label but 0 or the one asked for.
/// A scene file says itself what is what.
pub fn read(path: &Path, label: Option<u8>, progress: &Progress) -> Result<LabelVolume, FileError> {
    if scene::is_scene(path) {
        if label.is_some() {
            return Err(FileError::of(
                path,
                "a scene file names its structures itself; leave --label out",
            ));
        }
        return scene::load(path, progress).map(|(_, volume)| volume);
    }
    let voxels = read_voxels(path, progress)?;
    LabelVolume::from_voxels(&voxels, label, file_name(path), progress).map_err(|why| FileError::of(path, &why))
}

pub fn file_name(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

/// The labels as they lie in the file.
pub fn read_voxels(path: &Path, progress: &Progress) -> Result<Voxels, FileError> {
    let told = |why: String| FileError::of(path, &why);
    let bytes = whole(path, progress).map_err(told)?;
    let sink = Sink::labels(progress);
    let data = |name: &str| beside(path, name, progress);
    let voxels = match Format::of(&bytes) {
        Some(Format::Dicom) => dicom::read(&bytes).and_then(|object| dicom::structures::read(&object, path.parent())),
        Some(Format::Nrrd) => nrrd::read(&bytes, &data, sink),
        Some(Format::Nifti) => nifti::read(&bytes, sink).map(|v| v.named(BTreeMap::new())),
        Some(Format::MetaImage) => metaimage::read(&bytes, &data, sink).map(|v| v.named(BTreeMap::new())),
        None => Err(format!(
            "it is none of the formats that are read: {FORMATS}; export the segmentation as one of them"
        )),
    };
    voxels.map_err(told)
}

/// All of a file that is not too large.
pub fn whole(path: &Path, progress: &Progress) -> Result<Vec<u8>, String> {
    let kind = std::fs::metadata(path).map_err(|e| format!("it cannot be opened ({e}); check the path"))?;
    if !kind.is_file() {
        return Err(format!("it is not a file; give the path of a file: {FORMATS}"));
    }
    if kind.len() == 0 {
        return Err("it is empty; copy or export it again".to_owned());
    }
    let unreadable = |e: std::io::Error| format!("it cannot be read ({e}); check its permissions");
    let mut bytes = Vec::new();
    let mut file = File::open(path).map_err(unreadable)?.take(MAX_FILE_BYTES + 1);
    loop {
        progress.tell(Stage::Bytes, bytes.len(), kind.len() as usize)?;
        let part = file.by_ref().take(PART_BYTES).read_to_end(&mut bytes);
        if part.map_err(unreadable)? == 0 {
            break;
        }
    }
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(format!("it has more than {MAX_FILE_BYTES} bytes; crop it to the gland"));
    }
    Ok(bytes)
}

/// The data that a header names; a header from elsewhere must not reach outside of its folder.
pub fn beside(header: &Path, name: &str, progress: &Progress) -> Result<Vec<u8>, String> {
    let mut parts = Path::new(name).components();
    let inside = matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None));
    if !inside {
        return Err(format!(
            "its data are in \"{}\"; only a file in the same folder is read",
            super::element::short(name)
        ));
    }
    let path = header.with_file_name(name);
    whole(&path, progress).map_err(|why| format!("its data file {}: {why}", path.display()))
}
