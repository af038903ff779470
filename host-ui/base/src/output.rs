//! Folders for results: new or empty ones, so that results of two runs never mix.

use std::io::Error;
use std::path::{Path, PathBuf};

/// Reason why results cannot be written into a folder.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// It contains earlier files.
    #[error(
        "{} holds {count} files already, and results are not mixed; choose another folder, or delete it",
        .folder.display()
    )]
    NotEmpty {
        /// The folder.
        folder: PathBuf,
        /// Files and folders in it.
        count: usize,
    },
    /// It cannot be created or listed.
    #[error("{} cannot be created ({why}); choose another folder", .folder.display())]
    Create {
        /// The folder.
        folder: PathBuf,
        /// Error of the operating system.
        why: Error,
    },
}

/// Creates a folder for results, with its parents; an existing one must be empty.
pub fn new_folder(folder: &Path) -> Result<(), OutputError> {
    let create = |why| OutputError::Create {
        folder: folder.to_owned(),
        why,
    };
    std::fs::create_dir_all(folder).map_err(create)?;
    let count = std::fs::read_dir(folder).map_err(create)?.count();
    if count > 0 {
        return Err(OutputError::NotEmpty {
            folder: folder.to_owned(),
            count,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards against results next to those of an earlier run, which could not be told apart.
    #[test]
    fn only_an_empty_folder_is_accepted() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("a/b");
        new_folder(&out).unwrap();
        new_folder(&out).unwrap();
        std::fs::write(out.join("metrics.json"), "{}").unwrap();
        let why = new_folder(&out).unwrap_err();
        assert!(matches!(why, OutputError::NotEmpty { count: 1, .. }), "{why}");
        assert!(matches!(
            new_folder(&out.join("metrics.json")),
            Err(OutputError::Create { .. })
        ));
    }
}
