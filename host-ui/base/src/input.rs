//! Files that a user names: only regular files are read, and only up to a size.

use std::fs::{File, OpenOptions};
use std::io::{Error, Read};
use std::path::Path;

/// Reason why a file cannot be read; the texts follow the name of the file.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// No such file, or no right to open it.
    #[error("it cannot be opened ({0}); check the path")]
    Open(Error),
    /// A folder, a pipe or a device: reading it may never end.
    #[error("it is not a file; give the path of a file")]
    NotRegular,
    /// The file was opened, but reading failed.
    #[error("it cannot be read ({0}); check its permissions")]
    Read(Error),
    /// The file is larger than the caller accepts.
    #[error("it has more than {most_bytes} bytes")]
    TooLarge {
        /// The limit.
        most_bytes: u64,
    },
    /// The file is not UTF-8.
    #[error("it is not text (UTF-8)")]
    NotText,
}

/// Returns whether the name of a file has this ending, in capitals or not.
pub fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending))
}

/// Returns a regular file and its size in bytes. Refuses a pipe at once, even one
/// without a writer.
pub fn open(path: &Path) -> Result<(File, u64), InputError> {
    let mut options = OpenOptions::new();
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NONBLOCK);
    let file = options.read(true).open(path).map_err(InputError::Open)?;
    let about = file.metadata().map_err(InputError::Open)?;
    if !about.is_file() {
        return Err(InputError::NotRegular);
    }
    Ok((file, about.len()))
}

/// Returns the content of a regular file that has at most `most_bytes`.
pub fn read(path: &Path, most_bytes: u64) -> Result<Vec<u8>, InputError> {
    let (file, size) = open(path)?;
    if size > most_bytes {
        return Err(InputError::TooLarge { most_bytes });
    }
    let mut bytes = Vec::with_capacity(size as usize);
    // The file may grow while it is read.
    file.take(most_bytes + 1)
        .read_to_end(&mut bytes)
        .map_err(InputError::Read)?;
    if bytes.len() as u64 > most_bytes {
        return Err(InputError::TooLarge { most_bytes });
    }
    Ok(bytes)
}

/// Like [`read`], for a file that must be UTF-8.
pub fn read_text(path: &Path, most_bytes: u64) -> Result<String, InputError> {
    String::from_utf8(read(path, most_bytes)?).map_err(|_| InputError::NotText)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards against reading `/dev/zero` until memory ran out, and against waiting for a pipe
    /// forever.
    #[test]
    fn devices_pipes_and_folders_are_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        for path in [Path::new("/dev/zero"), pipe.as_path(), folder.path()] {
            let why = read(path, 10).unwrap_err();
            assert!(matches!(why, InputError::NotRegular), "{path:?}: {why}");
        }
    }

    #[test]
    fn a_file_is_read_up_to_its_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, b"12345").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"12345");
        assert!(matches!(read(&path, 4), Err(InputError::TooLarge { most_bytes: 4 })));
        std::fs::write(&path, [0xff]).unwrap();
        assert!(matches!(read_text(&path, 4), Err(InputError::NotText)));
    }
}
