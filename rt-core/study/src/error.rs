//! Why a study cannot be run.

use crate::problem::StudyProblem;
use std::path::PathBuf;
use stylet_insertions::TableError;
use stylet_runtime::rehearse::RehearseError;
use stylet_shm_schema::ProblemList;
use stylet_sim::scene::SceneError;
use stylet_write::WriteError;

/// Error that stops a study; an insertion that fails is a result and does not.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The study file or a plan.
    #[error("{}: it cannot be read ({source})", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// Everything that is wrong with the study file and its plans.
    #[error("{}: nothing was run; problems:\n  {}", .path.display(), .problems.to_string().replace('\n', "\n  "))]
    Invalid {
        /// The study file.
        path: PathBuf,
        /// Problems of the file.
        problems: ProblemList<StudyProblem>,
    },
    /// The folder.
    #[error("{}: it cannot be used ({source}); check the path and its rights", .path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// Results of another study, or of the same one before it was changed.
    #[error(
        "{}: it belongs to another study, or to another version of this study, its plans or rt-core. Give another folder with --out, or delete this one",
        .0.display()
    )]
    OtherStudy(PathBuf),
    /// The folder has shards of another division.
    #[error("{}: it is one of {found} shards, and this is one of {asked}; divide a folder in one way, or give another with --out", .path.display())]
    OtherDivision {
        /// The file or folder of that shard.
        path: PathBuf,
        /// Shards there.
        found: u32,
        /// Shards now.
        asked: u32,
    },
    /// A file of results.
    #[error(transparent)]
    Table(#[from] TableError),
    /// File in the folder of the results.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A scene cannot be built.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A body cannot be set up.
    #[error("the body of {scene} with a stiffness of {stiffness}: {why}")]
    Body {
        /// Name of the scene.
        scene: String,
        /// The factor.
        stiffness: f64,
        /// Error of the solver or the tissue.
        why: RehearseError,
    },
    /// No thread could be started.
    #[error("a thread for the insertions cannot be started ({0}); give fewer --jobs")]
    Thread(std::io::Error),
}
