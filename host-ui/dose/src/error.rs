//! Reasons why a dose cannot be computed.

use std::path::PathBuf;
use stylet_base::WriteError;
use stylet_base::format::printable;

/// Reason why a dose cannot be computed; the texts say what was found and what to do.
#[derive(Debug, thiserror::Error)]
pub enum DoseError {
    /// A triangle mesh that encloses no volume.
    #[error("{0}")]
    Mesh(&'static str),
    /// A grid with voxels of zero size, or with too many of them.
    #[error("{0}")]
    Grid(String),
    /// The name of a metric that does not exist.
    #[error("{0}")]
    Metric(String),
    /// Structures without the target.
    #[error("{0}")]
    Target(String),
    /// All errors in the text of a source.
    #[error("{0}")]
    Source(String),
    /// A source file that cannot be read or is invalid.
    #[error("{}: {}", .path.display(), printable(.why))]
    SourceFile {
        /// The file.
        path: PathBuf,
        /// Errors in the file.
        why: String,
    },
    /// A file that cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}
