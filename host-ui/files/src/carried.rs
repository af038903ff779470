//! The identity of a file of any format: of DICOM its own, of tables, plans and NRRD the lines
//! that were written with them.

use super::dicom::{self, Agreed, Identity, Shared};
use super::report::report;
use super::{FileError, Progress, bytes, scene};
use std::path::Path;

/// Number of bytes that identify a DICOM file.
const START_BYTES: u64 = 160;
/// Number of bytes in which lines are looked for.
const HEAD_BYTES: u64 = 1 << 18;

/// Compares the identities of files and reports remarks; returns what they have in common, if any
/// of them has an identity. Every command and the window compare their files here.
///
/// # Errors
///
/// Files of two patients, or of two frames of reference if they must share one.
pub fn together(files: &[Option<&Path>], shared: Shared) -> Result<Option<Identity>, FileError> {
    Ok(agreed(files, shared)?.reported())
}

/// Like [`together`], with the remarks for the caller.
pub fn agreed(files: &[Option<&Path>], shared: Shared) -> Result<Agreed, FileError> {
    let mut all = Vec::new();
    for file in files.iter().copied().flatten() {
        all.extend(Identity::of_path(file)?.map(|identity| (file.to_path_buf(), identity)));
    }
    dicom::agree(&all, shared)
}

impl Agreed {
    /// Reports the remarks, and returns the identity.
    pub fn reported(self) -> Option<Identity> {
        for (path, note) in &self.notes {
            report(path, std::slice::from_ref(note));
        }
        self.identity
    }
}

impl Identity {
    /// Returns the identity that a file carries, or the first image of a folder, or the volume of a
    /// scene file; `None` if it carries none.
    pub fn of_path(path: &Path) -> Result<Option<Self>, FileError> {
        if path.is_dir() {
            return Ok(of_folder(path));
        }
        let refused = |why| FileError::of(path, why);
        if bytes::start(path, START_BYTES).is_some_and(|start| dicom::is_dicom(&start)) {
            let content = bytes::whole(path, &Progress::default()).map_err(refused)?;
            return Ok(Some(Self::of(&dicom::read_head(&content).map_err(refused)?)));
        }
        let head = bytes::start(path, HEAD_BYTES).unwrap_or_default();
        let head = String::from_utf8_lossy(&head);
        if scene::is_scene(path) && !head.contains("\"stylet plan,") {
            // What is no scene is refused by the reader that it was meant for, in words about that.
            let scene = scene::read(path).ok();
            return scene.map_or(Ok(None), |scene| Self::of_path(&path.with_file_name(scene.volume)));
        }
        Ok(Self::of_parts(|name| line(&head, name)))
    }

    /// Returns comment lines for a table or a plan.
    pub fn comments(&self) -> String {
        let line = |(name, part): (&str, String)| format!("# {name}: {}\n", part);
        self.parts().into_iter().map(line).collect()
    }

    /// Returns pairs of the header of an NRRD file.
    pub fn pairs(&self) -> String {
        let line = |(name, part): (&str, String)| format!("{name}:={}\n", part);
        self.parts().into_iter().map(line).collect()
    }
}

/// Returns the comment line or pair of a name in the beginning of a file: `# name: value` or
/// `name:=value`.
fn line<'a>(head: &'a str, name: &str) -> Option<&'a str> {
    head.lines().find_map(|line| {
        // Spreadsheets put lines into quotation marks, and fill them up with separators.
        let line = line.trim_start_matches(['#', '"', ' ']).strip_prefix(name)?;
        let value = line.strip_prefix(":=").or_else(|| line.strip_prefix(':'))?;
        Some(value.trim_end_matches(['"', ',', ';', '\r', '\t']).trim())
    })
}

/// Returns the lines of a table or a header by their names, for [`DoseKind::of_lines`].
///
/// [`DoseKind::of_lines`]: dicom::dose::DoseKind::of_lines
pub fn lines_of(path: &Path) -> impl Fn(&str) -> Option<String> {
    let head = bytes::start(path, HEAD_BYTES).unwrap_or_default();
    let head = String::from_utf8_lossy(&head).into_owned();
    move |name| line(&head, name).map(str::to_owned)
}

/// Returns the identity of the first DICOM file of a folder, by name.
fn of_folder(folder: &Path) -> Option<Identity> {
    let entries = std::fs::read_dir(folder).ok()?;
    let mut paths: Vec<_> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.is_file())
        .collect();
    paths.sort();
    paths.iter().find_map(|path| match bytes::start(path, START_BYTES) {
        Some(start) if dicom::is_dicom(&start) => Identity::of_path(path).ok().flatten(),
        _ => None,
    })
}

#[cfg(test)]
mod tests;
