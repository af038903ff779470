//! Selects the core of a command, and the scene that it runs.

use clap::Args;
use std::path::{Path, PathBuf};
use stylet_shm_schema::BUILTIN_SCENES;
use stylet_shm_schema::Instance;

/// Options of every command that uses a core.
#[derive(Args, Clone, Debug, Default)]
pub struct CoreArgs {
    /// Name under which rt-core was started
    #[arg(long, default_value = "main", value_parser = Instance::new)]
    pub instance: Instance,
    /// What to run instead of rt-core's scene: paper, pelvis or full, which are built in, or a volume: NIfTI-1, NRRD,
    /// MetaImage, DICOM RT Structure Set or Segmentation, or a scene file (.toml)
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<SceneChoice>,
    /// Which label of the volume is the gland [default: all but 0]
    #[arg(long, value_name = "N", requires = "scene")]
    pub label: Option<u8>,
}

impl CoreArgs {
    /// Returns the file of the scene.
    pub fn file(&self) -> Option<&Path> {
        self.scene.as_ref().and_then(SceneChoice::file)
    }
}

/// A scene named by a user.
#[derive(Clone, Debug, PartialEq)]
pub enum SceneChoice {
    /// Index in [`BUILTIN_SCENES`].
    BuiltIn(usize),
    /// A file to read and upload.
    File(PathBuf),
}

impl From<&str> for SceneChoice {
    /// Parses a name; a file takes precedence over a built-in scene of the same name.
    fn from(name: &str) -> Self {
        let path = PathBuf::from(name);
        let number = BUILTIN_SCENES.iter().position(|scene| *scene == name);
        match number.filter(|_| !path.exists()) {
            Some(number) => Self::BuiltIn(number),
            None => Self::File(path),
        }
    }
}

impl SceneChoice {
    /// Returns the file of the scene; `None` for a built-in one.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::BuiltIn(_) => None,
            Self::File(path) => Some(path),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_built_in_scene_and_a_path_a_file() {
        assert_eq!(SceneChoice::from("pelvis"), SceneChoice::BuiltIn(1));
        for path in ["./pelvis", "gland.nii", "pelvis.nii.gz"] {
            assert_eq!(SceneChoice::from(path).file(), Some(Path::new(path)));
        }
    }
}
