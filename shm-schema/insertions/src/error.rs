//! Errors of a file of insertions.

use parquet::errors::ParquetError;
use std::path::PathBuf;
use stylet_write::WriteError;

/// Failure to read or write a file.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// Error of the file system.
    #[error("{}: it cannot be read ({source})", .path.display())]
    Open {
        /// The file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Not a file written by a study.
    #[error("{}: it is no complete Parquet file of a study ({why}); delete it and run its shard again", .path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Expected and actual content.
        why: String,
    },
    /// The rows cannot be encoded.
    #[error("the rows of a study cannot be written as Parquet: {0}")]
    Encode(#[from] ParquetError),
    /// Error of the file system.
    #[error(transparent)]
    Write(#[from] WriteError),
}
