//! What can be wrong with a file of insertions.

use parquet::errors::ParquetError;
use std::path::PathBuf;
use stylet_write::WriteError;

/// A file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The disk.
    #[error("{}: it cannot be read ({source})", .path.display())]
    Open {
        /// The file or folder.
        path: PathBuf,
        /// What the system reported.
        source: std::io::Error,
    },
    /// Not the file that a study writes.
    #[error("{}: it is no complete Parquet file of a study ({why}); delete it and run its shard again", .path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What was expected and what was found.
        why: String,
    },
    /// The rows do not make a file.
    #[error("the rows of a study cannot be written as Parquet: {0}")]
    Encode(#[from] ParquetError),
    /// The disk.
    #[error(transparent)]
    Write(#[from] WriteError),
}
