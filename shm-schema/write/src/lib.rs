//! Writes files that get their name only once they are complete.

#![warn(missing_docs)]

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Readable and writable for all, minus the umask, as for any new file.
#[cfg(unix)]
const MODE: u32 = 0o666;

/// Failure to write a file.
#[derive(Debug, thiserror::Error)]
#[error("{}: it cannot be written ({source}); check the folder and the space on the disk", .path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// Error of the operating system.
    pub source: io::Error,
}

/// Writes a file atomically: `path` is always the old file or the complete new one.
///
/// # Errors
/// If the folder does not exist, may not be written or is full; the old file is then unchanged.
///
/// ```
/// let folder = tempfile::tempdir().unwrap();
/// let path = folder.path().join("seeds.csv");
/// stylet_write::write_whole(&path, b"x_mm,y_mm,z_mm\n").unwrap();
/// assert_eq!(std::fs::read(&path).unwrap(), b"x_mm,y_mm,z_mm\n");
/// ```
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    write_streamed(path, |file| file.write_all(bytes))
}

/// As [`write_whole`], for content too large for memory: `write` gets a buffered file.
///
/// # Errors
/// As [`write_whole`], and every error of `write`.
pub fn write_streamed(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
) -> Result<(), WriteError> {
    streamed(path, write).map_err(|source| WriteError {
        path: path.to_owned(),
        source,
    })
}

fn streamed(path: &Path, write: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>) -> io::Result<()> {
    let fill = |file: &mut File| {
        let mut buffered = BufWriter::new(file);
        write(&mut buffered)?;
        buffered.flush()
    };
    // A link stays a link; a device or a pipe cannot be replaced.
    let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if std::fs::metadata(&path).is_ok_and(|about| !about.is_file()) {
        return fill(&mut File::options().write(true).open(&path)?);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    #[cfg_attr(not(unix), expect(unused_mut))]
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(MODE));
    let mut file = builder.tempfile_in(folder.unwrap_or(Path::new(".")))?;
    fill(file.as_file_mut())?;
    file.persist(&path)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.toml");
        write_whole(&path, b"old").unwrap();
        let failed = write_streamed(&path, |file| {
            file.write_all(b"half of the new")?;
            Err(io::Error::other("the disk is full"))
        });
        let text = failed.unwrap_err().to_string();
        assert!(
            text.contains("plan.toml") && text.contains("the disk is full"),
            "{text}"
        );
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        // A folder has the name.
        assert!(write_whole(folder.path(), b"new").is_err());
        assert_eq!(names(folder.path()), ["plan.toml"]);
    }

    #[test]
    fn a_new_file_has_the_permissions_of_any_new_file() {
        let folder = tempfile::tempdir().unwrap();
        let mode = |name: &str| {
            std::fs::metadata(folder.path().join(name))
                .unwrap()
                .permissions()
                .mode()
        };
        write_whole(&folder.path().join("ours"), b"").unwrap();
        std::fs::write(folder.path().join("plain"), b"").unwrap();
        assert_eq!(mode("ours"), mode("plain"));
    }

    #[test]
    fn links_and_devices_are_written_through() {
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        std::fs::write(&real, "old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write_whole(&link, b"new").unwrap();
        assert!(link.is_symlink());
        assert_eq!(std::fs::read(&real).unwrap(), b"new");
        write_whole(Path::new("/dev/null"), b"anything").unwrap();
        assert!(!std::fs::metadata("/dev/null").unwrap().is_file());
        assert!(write_whole(Path::new("/proc/nowhere/file"), b"").is_err());
    }
}
