//! Reasons why a dose cannot be computed.

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
}
