//! Why a file was refused: what was found, what was expected, what to do.

use std::path::{Path, PathBuf};
use stylet_base::format::printable;
use stylet_base::input::InputError;

/// Why the content of a file was refused or could not be made; the texts follow the name of the file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ContentError {
    /// The user ended the work.
    #[error("it was cancelled")]
    Cancelled,
    /// The file has no bytes.
    #[error("it is empty; copy or export it again")]
    Empty,
    /// The file is larger than any segmentation.
    #[error("it has more than {most_bytes} bytes; crop it to the gland")]
    TooLarge {
        /// The limit.
        most_bytes: u64,
    },
    /// The file cannot be opened or read at all.
    #[error("{0}")]
    Unreadable(String),
    /// The file cannot be written.
    #[error("it cannot be written ({0}); check the folder and the space on the disk")]
    Unwritable(String),
    /// The content is not what it must be.
    #[error("{0}")]
    Invalid(String),
}

impl From<InputError> for ContentError {
    fn from(why: InputError) -> Self {
        Self::Unreadable(why.to_string())
    }
}

impl From<String> for ContentError {
    fn from(why: String) -> Self {
        Self::Invalid(why)
    }
}

impl From<&str> for ContentError {
    fn from(why: &str) -> Self {
        Self::Invalid(why.to_owned())
    }
}

impl ContentError {
    /// The same error, which says in what part of the file it is.
    pub(crate) fn within(self, part: impl std::fmt::Display) -> Self {
        match self {
            Self::Invalid(why) => Self::Invalid(format!("{part}: {why}")),
            other => other,
        }
    }

    /// One error from the problems that were collected.
    pub(crate) fn all(problems: Vec<String>) -> Result<(), Self> {
        match problems.as_slice() {
            [] => Ok(()),
            [one] => Err(Self::Invalid(one.clone())),
            many => Err(Self::Invalid(format!(
                "{} problems\n  {}",
                many.len(),
                many.join("\n  ")
            ))),
        }
    }
}

/// A file that was refused or could not be written, with its path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: {}", .path.display(), printable(&.why.to_string()))]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// Why it was refused.
    #[source]
    pub why: ContentError,
}

impl FileError {
    /// The error of one file.
    pub fn of(path: &Path, why: impl Into<ContentError>) -> Self {
        Self {
            path: path.to_owned(),
            why: why.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A field of 50 MB gave a message of 50 MB, and escape sequences went to the terminal.
    #[test]
    fn messages_are_bounded_and_hold_no_escape_sequence() {
        let long = format!("\u{1b}[31mred\u{9b}2J {}", "x".repeat(50_000_000));
        let shown = FileError::of(Path::new("a.csv"), long).to_string();
        assert!(
            shown.starts_with("a.csv: [31mred2J xx") && shown.len() < 5000,
            "{}",
            shown.len()
        );
        assert!(shown.ends_with("xx..."));
    }
}
