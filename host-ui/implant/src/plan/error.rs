//! Reasons why a plan cannot be made, changed, read or written.

use super::needle::SEED_LENGTH_M;
use super::template::{Hole, NotAHole};
use std::path::{Path, PathBuf};
use stylet_base::WriteError;
use stylet_files::FileError;

/// Reason why a plan cannot be made, changed, read or written; the text gives the remedy if there
/// is one.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// An edit names a needle that the plan does not have.
    #[error("there is no such needle")]
    NoNeedle,
    /// An edit names a seed that the needle does not have.
    #[error("there is no such seed on the needle")]
    NoSeed,
    /// Two needles cannot share a hole.
    #[error("a needle goes through {0} already")]
    HoleTaken(Hole),
    /// A row without seeds, or with seeds that overlap.
    #[error(
        "a needle has at least one seed, and from one to the next it is {} mm or more; remove the needle instead",
        SEED_LENGTH_M * 1e3
    )]
    BadRow,
    /// A strand loses seeds at its ends only.
    #[error("a seed in the middle of a strand cannot be removed; make the needle loose first")]
    InsideStrand,
    /// The name of a hole is invalid.
    #[error(transparent)]
    Hole(#[from] NotAHole),
    /// The surface of a structure is not closed.
    #[error("the surface of {name}: {why}")]
    Surface {
        /// Name of the structure.
        name: String,
        /// Problem of the surface.
        why: String,
    },
    /// No needle fits.
    #[error("no hole of the template reaches the target past the structures to be spared; plan by hand")]
    NoWay,
    /// The strength cannot be derived from the dose.
    #[error("the seeds give the target no dose")]
    NoDose,
    /// Seeds added to those in the tissue must have one strength.
    #[error("with seeds in the tissue, those to be added must have one strength")]
    Strengths,
    /// The search was cancelled.
    #[error("the search was cancelled")]
    Cancelled,
    /// Seeds need a known source.
    #[error("{0}")]
    Source(String),
    /// A text is not a plan; every problem, one a line.
    #[error("{}", .0.join("\n"))]
    Invalid(Vec<String>),
    /// A file cannot be read as a plan, or a plan cannot be written in its format.
    #[error("{}: {why}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Problem of the file.
        why: String,
    },
    /// A file was refused, or belongs to another patient.
    #[error(transparent)]
    Refused(#[from] FileError),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl PlanError {
    /// Creates an error about a file, which it names.
    pub(super) fn of_file(path: &Path, why: impl ToString) -> Self {
        Self::File {
            path: path.to_owned(),
            why: why.to_string(),
        }
    }
}
