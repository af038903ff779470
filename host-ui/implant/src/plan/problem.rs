//! Problems of files with needles or seeds, all of a file at once.

use super::template::{Hole, NotAHole};

/// Format of a plan file.
pub(super) const FORMAT: &str = "stylet plan, mm, RAS";
/// Largest coordinate in a file.
pub(super) const MAX_MM: f64 = 10_000.0;

/// Problem of a plan file.
#[derive(Debug, thiserror::Error)]
pub enum FileProblem {
    /// Not the TOML of a plan.
    #[error("it is not a plan: {0}")]
    Toml(#[from] toml::de::Error),
    /// Another format, or another version of it.
    #[error("format is \"{0}\"; it must be \"{FORMAT}\"")]
    Format(String),
    /// More needles than a plan may have.
    #[error("{given} needles; at most {most}")]
    TooManyNeedles {
        /// Needles of the file.
        given: usize,
        /// Largest number.
        most: usize,
    },
    /// More seeds than the core takes.
    #[error("{given} seeds; at most {most} can be placed")]
    TooManySeeds {
        /// Seeds of the file.
        given: usize,
        /// Largest number.
        most: usize,
    },
    /// A value beyond its limits.
    #[error("{key} is {value}; it must be {least} to {most}")]
    Range {
        /// Key of the value.
        key: &'static str,
        /// The value.
        value: f64,
        /// Smallest value.
        least: f64,
        /// Largest value.
        most: f64,
    },
    /// A place far away, or not a place.
    #[error("{key} is {mm:?}; coordinates must be within {MAX_MM} mm")]
    Place {
        /// Key of the place.
        key: &'static str,
        /// The place.
        mm: [f64; 3],
    },
    /// A direction of another length than 1.
    #[error("{key} is {axis:?}, not a unit vector")]
    Direction {
        /// Key of the direction.
        key: &'static str,
        /// The direction.
        axis: [f64; 3],
    },
    /// Not one strength for each seed.
    #[error("{places} seeds in seed_along_mm and {strengths} in strength_u")]
    Strengths {
        /// Seeds with a place.
        places: usize,
        /// Seeds with a strength.
        strengths: usize,
    },
    /// The name of a hole is invalid.
    #[error(transparent)]
    Hole(#[from] NotAHole),
    /// Problem of a needle.
    #[error("needle {number}: {problem}")]
    Needle {
        /// Number of the needle, from 1.
        number: usize,
        /// Its problem.
        problem: Box<FileProblem>,
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
