//! The bytes of files: regular files only, bounded, with progress; and whole files written at once.

use super::element::short;
use super::error::{ContentError, invalid};
use super::progress::{Progress, Stage};
use std::io::Read;
use std::path::{Component, Path};
use stylet_base::input::{self, InputError};

/// Largest size of a file, more than any segmentation of a pelvis.
const MAX_FILE_BYTES: u64 = 1 << 30;
/// Number of bytes read between two reports of progress.
const PART_BYTES: u64 = 1 << 23;

/// Returns the last part of a path, for display.
pub fn file_name(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

/// Returns the folder of a file; a bare name is in the present one.
pub fn folder(path: &Path) -> &Path {
    let parent = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    parent.unwrap_or(Path::new("."))
}

/// Reads a regular file that is neither empty nor larger than 1 GiB.
pub fn whole(path: &Path, progress: &Progress) -> Result<Vec<u8>, ContentError> {
    let (file, size) = input::open(path)?;
    if size == 0 {
        return Err(ContentError::Empty);
    }
    let mut bytes = Vec::new();
    let mut file = file.take(MAX_FILE_BYTES + 1);
    loop {
        progress.report(Stage::Bytes, bytes.len(), size as usize)?;
        let part = file.by_ref().take(PART_BYTES).read_to_end(&mut bytes);
        if part.map_err(InputError::Read)? == 0 {
            break;
        }
    }
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(ContentError::TooLarge {
            most_bytes: MAX_FILE_BYTES,
        });
    }
    Ok(bytes)
}

/// Returns the first bytes of a regular file, at most `count`; `None` for anything else.
pub fn start(path: &Path, count: u64) -> Option<Vec<u8>> {
    let (file, _) = input::open(path).ok()?;
    let mut bytes = Vec::new();
    file.take(count).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// Reads the data file that a header names; a header from elsewhere must not reach outside of its
/// folder.
pub fn data_file(header: &Path, name: &str, progress: &Progress) -> Result<Vec<u8>, ContentError> {
    let mut parts = Path::new(name).components();
    let inside = matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None));
    if !inside {
        return Err(invalid!(
            "its data are in \"{}\"; only a file in the same folder is read",
            short(name)
        ));
    }
    let path = header.with_file_name(name);
    whole(&path, progress).map_err(|why| invalid!("its data file {}: {why}", path.display()))
}
