//! Files and folders of the commands.

use serde::Serialize;
use std::io::{self, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use stylet_write::{WriteError, write_whole};

/// A file or a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DiskError {
    #[error("cannot read {}: {source}", .path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{} is there already, and is not overwritten: choose another folder, or move it away", .0.display())]
    Kept(PathBuf),
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

/// Most bytes of a file that is read whole: a release of this program is the largest.
const MOST_BYTES: u64 = 1 << 30;

/// Reads a plain file: a pipe or a device in its place could hold the program for ever.
pub fn read(path: &Path) -> Result<Vec<u8>, DiskError> {
    let failed = DiskError::read(path);
    let open = std::fs::File::options()
        .read(true)
        .custom_flags(libc::O_NONBLOCK)
        .open(path);
    let file = open.map_err(&failed)?;
    let about = file.metadata().map_err(&failed)?;
    if !about.is_file() || about.len() > MOST_BYTES {
        return Err(failed(io::Error::other("not a file of at most 1 GiB")));
    }
    let mut bytes = Vec::new();
    file.take(MOST_BYTES).read_to_end(&mut bytes).map_err(&failed)?;
    Ok(bytes)
}

pub fn read_text(path: &Path) -> Result<String, DiskError> {
    let text = String::from_utf8(read(path)?);
    text.map_err(|_| DiskError::read(path)(io::ErrorKind::InvalidData.into()))
}

/// Fails if `file` exists: evidence is never overwritten.
pub fn keep_what_is_there(file: &Path) -> Result<(), DiskError> {
    match file.symlink_metadata() {
        Ok(_) => Err(DiskError::Kept(file.to_owned())),
        Err(_) => Ok(()),
    }
}

/// Makes a folder and those above it.
pub fn make(folder: &Path) -> Result<(), DiskError> {
    std::fs::create_dir_all(folder).map_err(|source| DiskError::Folder {
        path: folder.to_owned(),
        source,
    })
}

/// Returns a report as its file holds it.
pub fn json(report: &impl Serialize) -> Result<String, DiskError> {
    Ok(serde_json::to_string_pretty(report)? + "\n")
}

/// Writes a report as `NAME.json` and `NAME.html` into `folder`, and prints their paths.
pub fn write_report(folder: &Path, name: &str, report: &impl Serialize, page: &str) -> Result<(), DiskError> {
    let json = json(report)?;
    make(folder)?;
    for (ending, text) in [("html", page), ("json", &json)] {
        let path = folder.join(format!("{name}.{ending}"));
        write_whole(&path, text.as_bytes())?;
        println!("{}", path.display());
    }
    Ok(())
}
