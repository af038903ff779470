//! Problems of a study file and its plans, each with its key, its value and the permitted ones.

use crate::plan::PlanProblem;
use crate::quantity;
use crate::spread::SpreadProblem;
use std::path::PathBuf;
use stylet_shm_schema::{BUILTIN_SCENES, ParameterProblems};
use stylet_sim::scene::TissueKind;

pub(crate) const LONGEST_NAME: usize = 60;
pub(crate) const MOST_IMPLANTS: u32 = 1_000_000;

/// Problem of a study file.
#[derive(Debug, thiserror::Error)]
pub enum StudyProblem {
    /// Not the TOML of a study.
    #[error("it is no study: {0}")]
    Toml(#[from] toml::de::Error),
    /// A name that is no part of an id.
    #[error("name is \"{0}\"; give 1 to {LONGEST_NAME} letters, digits, '-', '_' or '.'")]
    Name(String),
    /// Too few or too many draws of each gland.
    #[error("implants is {0}; it must be a whole number from 1 to {MOST_IMPLANTS}")]
    Implants(u32),
    /// An unknown tissue model.
    #[error("tissue is \"{0}\"; there are {names}", names = TissueKind::ALL.map(TissueKind::name).join(", "))]
    Tissue(String),
    /// No gland.
    #[error("there is no gland: give [[gland]] with scene and plan once or several times")]
    NoGland,
    /// Problem of a gland.
    #[error("gland {number}: {problem}")]
    Gland {
        /// Number of the gland, from 1.
        number: usize,
        /// Its problem.
        problem: GlandProblem,
    },
    /// Problem of a quantity.
    #[error("vary.{key}: {problem}")]
    Quantity {
        /// Key of the quantity.
        key: String,
        /// Its problem.
        problem: QuantityProblem,
    },
    /// More parameters than corners can be tried of.
    #[error("vary: {given} parameters of the core; at most {most} can vary at once")]
    TooManyParameters {
        /// Parameters of the file.
        given: usize,
        /// Largest number.
        most: usize,
    },
    /// Values that the device does not hold together.
    #[error("vary: {values} cannot be together: {why}")]
    Together {
        /// The parameters with their values.
        values: String,
        /// Problems of the set.
        why: ParameterProblems,
    },
}

/// Problem of a gland.
#[derive(Debug, thiserror::Error)]
pub enum GlandProblem {
    /// An unknown scene.
    #[error("scene is \"{0}\"; there are {scenes}", scenes = BUILTIN_SCENES.join(", "))]
    Scene(String),
    /// The plan cannot be read.
    #[error("plan {}: it cannot be read ({why})", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        why: std::io::Error,
    },
    /// Problem of the plan.
    #[error("plan {}: {problem}", .path.display())]
    Plan {
        /// The file.
        path: PathBuf,
        /// Its problem.
        problem: PlanProblem,
    },
    /// Two glands whose insertions would have the same ids.
    #[error("there is a gland of scene {scene} with plan {plan} already: their ids would be the same")]
    Twice {
        /// Scene of both.
        scene: String,
        /// Name of the plan of both.
        plan: String,
    },
}

/// Problem of a quantity that varies.
#[derive(Debug, thiserror::Error)]
pub enum QuantityProblem {
    /// An unknown quantity.
    #[error("there is no such quantity; there are {keys}", keys = quantity::keys().collect::<Vec<_>>().join(", "))]
    Unknown,
    /// Problem of its spread.
    #[error(transparent)]
    Spread(#[from] SpreadProblem),
    /// A spread beyond the limits.
    #[error("it reaches from {least} to {most}; the limits are {low} to {high}", least = .reach[0], most = .reach[1], low = .limits[0], high = .limits[1])]
    Reach {
        /// Ends of the spread.
        reach: [f64; 2],
        /// Ends that are allowed.
        limits: [f64; 2],
    },
    /// A parameter without effect in that tissue.
    #[error(
        "it does nothing in tissue \"{tissue}\", where needles slip by force; leave it out, or take tissue = \"paper\"",
        tissue = .0.name()
    )]
    NoPart(TissueKind),
}
