//! Problems of files with needles or seeds, all of a file at once.

use super::template::{Hole, NotAHole};
use stylet_procedure::PlanProblem;

/// Problem of a plan file.
#[derive(Debug, thiserror::Error)]
pub enum FileProblem {
    /// Not the TOML of a plan.
    #[error("it is not a plan: {0}")]
    Toml(#[from] toml::de::Error),
    /// Problem of its contents.
    #[error(transparent)]
    Plan(#[from] PlanProblem),
    /// The name of a hole is invalid.
    #[error("needle {number}: {problem}")]
    Hole {
        /// Number of the needle, from 1.
        number: usize,
        /// Problem of the name.
        problem: NotAHole,
    },
}

/// Problem of a table of seeds that are to be on needles.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum SeedsProblem {
    /// The seeds of a needle lie apart.
    #[error("its seeds are not on one line; correct them, or leave the column needle out")]
    NotOnLine,
    /// The seeds of a needle lie off its hole.
    #[error(
        "its seeds are {off_mm:.1} mm off hole {hole} of this scene's template; correct them, or leave the column hole out"
    )]
    OffHole {
        /// Distance from the hole, mm.
        off_mm: f64,
        /// The hole.
        hole: Hole,
    },
    /// The name of a hole is invalid.
    #[error(transparent)]
    Hole(#[from] NotAHole),
    /// Problem of a needle with a number.
    #[error("needle {number}: {problem}")]
    Needle {
        /// Number of the needle.
        number: u32,
        /// Its problem.
        problem: Box<SeedsProblem>,
    },
}
