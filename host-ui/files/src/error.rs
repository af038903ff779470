//! Reasons why a file was refused: what was found, what was expected, what to do.

use std::path::{Path, PathBuf};
use stylet_base::format::printable;
use stylet_base::input::InputError;

/// Reason why the content of a file was refused or could not be created; the texts follow the name
/// of the file.
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
    /// The content is invalid.
    #[error("{0}")]
    Invalid(String),
}

/// Formats the reason why the content of a file is refused.
macro_rules! invalid {
    ($($words:tt)*) => { $crate::error::ContentError::Invalid(format!($($words)*)) };
}
pub(crate) use invalid;

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
    /// Returns the same error, with the part of the file it is in.
    pub(crate) fn within(self, part: impl std::fmt::Display) -> Self {
        match self {
            Self::Invalid(why) => Self::Invalid(format!("{part}: {why}")),
            other => other,
        }
    }

    /// Combines the collected problems into one error.
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

/// Error of a file that was refused or could not be written, with its path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: {}", .path.display(), printable(&.why.to_string()))]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// Reason of the refusal.
    #[source]
    pub why: ContentError,
}

impl FileError {
    /// Returns the error of one file.
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

    /// Guards against a message of 50 MB from a field of 50 MB, and against escape sequences on the
    /// terminal.
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
