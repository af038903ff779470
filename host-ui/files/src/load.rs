//! A label volume from any file that names one: the volume itself, or a scene file.

use super::bytes::file_name;
use super::error::FileError;
use super::open::read_voxels;
use super::progress::Progress;
use super::scene;
use super::volume::LabelVolume;
use std::path::Path;

/// Returns the tissue of a label volume: its named structures, or else every label but 0, or only
/// `label`. A scene file defines its own structures.
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
    LabelVolume::from_voxels(&voxels, label, file_name(path), progress).map_err(|why| FileError::of(path, why))
}
