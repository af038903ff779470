//! Reasons why a plan cannot be made, changed, read or written.

use super::needle::SEED_LENGTH_M;
use super::problem::FileProblem;
use super::template::{Hole, NotAHole};
use std::error::Error;
use std::path::{Path, PathBuf};
use stylet_base::WriteError;
use stylet_base::format::printable;
use stylet_dose::DoseError;
use stylet_files::FileError;
use stylet_shm_schema::ProblemList;

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
        why: DoseError,
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
    /// A source of another name than those that come with the program.
    #[error(transparent)]
    UnknownSource(DoseError),
    /// The source for files that name none.
    #[error("the usual source is not known")]
    NoUsualSource,
    /// The prescription for files that name none.
    #[error("the usual source has no prescription")]
    NoUsualPrescription,
    /// Seeds of another nuclide than those of the known sources.
    #[error(
        "its seeds are {}, and no source of that comes with the program; compute their dose with host-ui dose --source FILE",
        printable(.0)
    )]
    UnknownIsotope(String),
    /// An RT Plan holds more of the source than its name.
    #[error("an RT Plan contains isotope and half-life, and those of source {0} are unknown; write .toml")]
    SourceOfRtPlan(String),
    /// A text is not a plan.
    #[error(transparent)]
    Invalid(#[from] ProblemList<FileProblem>),
    /// A plan cannot be written as TOML.
    #[error("the plan cannot be written as TOML: {0}")]
    ToToml(#[from] toml::ser::Error),
    /// A plan without seeds gives none.
    #[error("the plan has no seed; load its needles first")]
    NoSeeds,
    /// The name of a file has another ending.
    #[error("its name must end in .toml, .csv or .dcm")]
    Ending,
    /// A file cannot be read as a plan, or a plan cannot be written in its format.
    #[error("{}: {why}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Problem of the file.
        #[source]
        why: Box<dyn Error + Send + Sync>,
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
    pub(super) fn of_file(path: &Path, why: impl Error + Send + Sync + 'static) -> Self {
        Self::File {
            path: path.to_owned(),
            why: Box::new(why),
        }
    }
}
