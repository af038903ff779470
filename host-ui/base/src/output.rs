//! Folders for results: new or empty ones, so that results of two runs never lie in one.

use std::io::Error;
use std::path::{Path, PathBuf};

/// Why results cannot be written into a folder.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// It holds files of before.
    #[error(
        "{} holds {count} files already, and results are not added to others; choose another folder, or delete it",
        .folder.display()
    )]
    NotEmpty {
        /// The folder.
        folder: PathBuf,
        /// Files and folders in it.
        count: usize,
    },
    /// It cannot be made or looked into.
    #[error("{} cannot be created ({why}); choose another folder", .folder.display())]
    Create {
        /// The folder.
        folder: PathBuf,
        /// What the system reported.
        why: Error,
    },
}

/// Makes a folder for results, with those above it; one that is there must be empty.
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

    /// Results went into a folder beside those of an earlier run, and nobody could see which belonged together.
    #[test]
    fn a_folder_with_files_is_refused_and_an_empty_one_is_taken() {
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
