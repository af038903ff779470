//! Why a file was not taken: what was found, what was expected, what to do.

use std::path::Path;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError(pub String);

impl FileError {
    pub fn of(path: &Path, why: &str) -> Self {
        Self(format!("{}: {why}", path.display()))
    }
}

impl std::fmt::Display for FileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for FileError {}

/// One message out of all problems.
pub fn all(problems: Vec<String>) -> Result<(), String> {
    match problems.as_slice() {
        [] => Ok(()),
        [one] => Err(one.clone()),
        many => Err(format!("{} problems\n  {}", many.len(), many.join("\n  "))),
    }
}
