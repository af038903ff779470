//! Files and folders of the commands.

use serde::Serialize;
use std::io;
use std::path::{Path, PathBuf};
use stylet_write::{WriteError, write_whole};

/// A file or a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DiskError {
    #[error("cannot read {}: {source}", .path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("cannot make {}: {source}", .path.display())]
    Folder { path: PathBuf, source: io::Error },
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("the report cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

impl DiskError {
    /// Returns the error of reading `path`.
    pub fn read(path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self::Read {
            path: path.to_owned(),
            source,
        }
    }
}

pub fn read(path: &Path) -> Result<Vec<u8>, DiskError> {
    std::fs::read(path).map_err(DiskError::read(path))
}

pub fn read_text(path: &Path) -> Result<String, DiskError> {
    std::fs::read_to_string(path).map_err(DiskError::read(path))
}

/// Makes a folder and those above it.
pub fn make(folder: &Path) -> Result<(), DiskError> {
    std::fs::create_dir_all(folder).map_err(|source| DiskError::Folder {
        path: folder.to_owned(),
        source,
    })
}

/// Writes a report as `NAME.json` and `NAME.html` into `folder`, and prints their paths.
pub fn write_report(folder: &Path, name: &str, report: &impl Serialize, page: &str) -> Result<(), DiskError> {
    let json = serde_json::to_string_pretty(report)? + "\n";
    make(folder)?;
    for (ending, text) in [("html", page), ("json", &json)] {
        let path = folder.join(format!("{name}.{ending}"));
        write_whole(&path, text.as_bytes())?;
        println!("{}", path.display());
    }
    Ok(())
}
