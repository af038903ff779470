//! Reasons why there is no page.

use std::path::PathBuf;
use stylet_base::WriteError;
use stylet_dose::DoseError;
use stylet_files::FileError;
use stylet_insertions::{Shard, TableError};
use stylet_report::picture::DrawError;

/// Problem of a folder of results.
#[derive(Debug, thiserror::Error)]
pub enum PopulationError {
    /// No finished shard.
    #[error(
        "{}: there is no finished shard (shard-*.parquet); run `rt-core study STUDY.toml --out` with this folder until it is done",
        .0.display()
    )]
    Empty(PathBuf),
    /// A file of a shard.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Results of different studies.
    #[error("{}: it is of another study, or of another version of it, than {}; keep each in a separate folder", .other.display(), .first.display())]
    OtherStudy {
        /// The first file.
        first: PathBuf,
        /// The one that differs.
        other: PathBuf,
    },
    /// One study divided in two ways.
    #[error("{}: shards {first} and {other} divide the study differently, and would count insertions twice; keep one division", .folder.display())]
    OtherDivision {
        /// The folder.
        folder: PathBuf,
        /// One shard.
        first: Shard,
        /// One of another division.
        other: Shard,
    },
    /// One id, two rows.
    #[error("insertion {0} is there twice; delete the shard that was copied")]
    Twice(String),
    /// The structures for dose.
    #[error(transparent)]
    Structures(#[from] FileError),
    /// Dose cannot be computed.
    #[error(transparent)]
    Dose(#[from] DoseError),
    /// Seeds without a source.
    #[error("the plan names source \"{model}\"; known are {known}")]
    Source {
        /// Name of the model in the plan.
        model: String,
        /// Models that come with the program.
        known: String,
    },
    /// A picture.
    #[error(transparent)]
    Picture(#[from] DrawError),
    /// A file of the results.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A table.
    #[error("a table cannot be written: {0}")]
    Csv(#[from] csv::Error),
}
