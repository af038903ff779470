//! The needles of a plan file, as far as insertions need them; `host-ui` writes such files and checks all of them.

use nalgebra::{Unit, Vector3};
use serde::Deserialize;
use stylet_shm_schema::{MAX_SEEDS, ProblemList, SEED_LENGTH_M};

const FORMAT: &str = "stylet plan, mm, RAS";
const FARTHEST_MM: f64 = 10_000.0;
const LONGEST_MM: f64 = 500.0;

#[derive(Deserialize)]
struct PlanFile {
    format: String,
    source: String,
    prescription_gy: f64,
    #[serde(default, rename = "needle")]
    needles: Vec<NeedleFile>,
}

#[derive(Deserialize)]
struct NeedleFile {
    #[serde(default)]
    hole: String,
    entry_mm: [f64; 3],
    direction: [f64; 3],
    #[serde(default)]
    retract_to_mm: f64,
    spacer_mm: Option<f64>,
    seed_along_mm: Vec<f64>,
    strength_u: Vec<f64>,
}

/// Needles to insert.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Model of the seeds.
    pub source: String,
    /// Prescribed dose.
    pub prescription_gy: f64,
    /// Needles in the order of the file.
    pub needles: Vec<Needle>,
}

/// One needle, mm, patient frame, which is that of a built-in scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Needle {
    /// Empty where the file names none.
    pub hole: String,
    /// Place where its tip starts.
    pub entry_mm: Vector3<f64>,
    /// Unit vector into the body.
    pub direction: Unit<Vector3<f64>>,
    /// Place that its tip is drawn back to, from the entry.
    pub retract_to_mm: f64,
    /// Distance from middle to middle of two seeds of a strand.
    pub strand_pitch_mm: Option<f64>,
    /// Distance from the entry and strength of its seeds, deepest first.
    pub seeds: Vec<(f64, f64)>,
}

/// Problem of a plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanProblem {
    /// Not the TOML of a plan.
    #[error("it is no plan of host-ui: {0}")]
    Toml(#[from] toml::de::Error),
    /// Another format, or another version of it.
    #[error("format is \"{0}\"; it must be \"{FORMAT}\"")]
    Format(String),
    /// An implausible prescription.
    #[error("prescription_gy is {0}; it must be 0.001 to 10000")]
    Prescription(f64),
    /// No needle.
    #[error("it has no needle")]
    NoNeedle,
    /// Problem of a needle.
    #[error("needle {number}: {problem}")]
    Needle {
        /// Number of the needle, from 1.
        number: usize,
        /// Its problem.
        problem: NeedleProblem,
    },
}

/// Problem of a needle in a plan.
#[derive(Debug, thiserror::Error)]
pub enum NeedleProblem {
    /// An entry far away, or not a place.
    #[error("entry_mm is {0:?}; coordinates must be within {FARTHEST_MM} mm")]
    Entry([f64; 3]),
    /// A direction of another length than 1.
    #[error("direction is {0:?}, no unit vector")]
    Direction([f64; 3]),
    /// A retraction beyond the needle.
    #[error("retract_to_mm is {0}; it must be 0 to {LONGEST_MM}")]
    Retraction(f64),
    /// A spacer that no strand has.
    #[error("spacer_mm is {0}; it must be 0.1 to 50")]
    Spacer(f64),
    /// Not one strength for each seed.
    #[error("{places} seeds in seed_along_mm and {strengths} in strength_u")]
    Strengths {
        /// Seeds with a place.
        places: usize,
        /// Seeds with a strength.
        strengths: usize,
    },
    /// More seeds than the core takes.
    #[error("{0} seeds; at most {MAX_SEEDS}")]
    TooManySeeds(usize),
    /// No seed.
    #[error("it has no seed, and an insertion ends with its last seed: leave the needle out")]
    NoSeed,
    /// A seed beyond the needle.
    #[error("seed_along_mm has {0}; it must be 0 to {LONGEST_MM}")]
    Place(f64),
}

/// Reads a plan, or lists every problem with it.
pub fn of_text(text: &str) -> Result<Plan, ProblemList<PlanProblem>> {
    let file: PlanFile = toml::from_str(text).map_err(PlanProblem::from)?;
    let mut problems = Vec::new();
    if file.format != FORMAT {
        problems.push(PlanProblem::Format(file.format));
    }
    if !(1e-3..=1e4).contains(&file.prescription_gy) {
        problems.push(PlanProblem::Prescription(file.prescription_gy));
    }
    if file.needles.is_empty() {
        problems.push(PlanProblem::NoNeedle);
    }
    let needles = file.needles.into_iter().enumerate().map(|(n, needle)| {
        let mut found = Vec::new();
        let needle = checked(needle, &mut found);
        let number = n + 1;
        problems.extend(found.into_iter().map(|problem| PlanProblem::Needle { number, problem }));
        needle
    });
    let needles = needles.collect();
    ProblemList::check(problems)?;
    Ok(Plan {
        source: file.source,
        prescription_gy: file.prescription_gy,
        needles,
    })
}

fn checked(file: NeedleFile, problems: &mut Vec<NeedleProblem>) -> Needle {
    let direction = Vector3::from(file.direction);
    // NaN compares false.
    if !file.entry_mm.iter().all(|c| c.abs() <= FARTHEST_MM) {
        problems.push(NeedleProblem::Entry(file.entry_mm));
    }
    if !(0.999..1.001).contains(&direction.norm()) {
        problems.push(NeedleProblem::Direction(file.direction));
    }
    if !(0.0..=LONGEST_MM).contains(&file.retract_to_mm) {
        problems.push(NeedleProblem::Retraction(file.retract_to_mm));
    }
    if let Some(spacer) = file.spacer_mm.filter(|s| !(0.1..=50.0).contains(s)) {
        problems.push(NeedleProblem::Spacer(spacer));
    }
    let (places, strengths) = (file.seed_along_mm, file.strength_u);
    if places.len() != strengths.len() {
        problems.push(NeedleProblem::Strengths {
            places: places.len(),
            strengths: strengths.len(),
        });
    }
    if places.len() > MAX_SEEDS {
        problems.push(NeedleProblem::TooManySeeds(places.len()));
    }
    if places.is_empty() {
        problems.push(NeedleProblem::NoSeed);
    }
    let is_beyond = |along: &&f64| !(0.0..=LONGEST_MM).contains(*along);
    problems.extend(places.iter().filter(is_beyond).copied().map(NeedleProblem::Place));
    let mut seeds: Vec<(f64, f64)> = places.into_iter().zip(strengths).collect();
    seeds.sort_by(|a, b| b.0.total_cmp(&a.0));
    Needle {
        hole: file.hole,
        entry_mm: file.entry_mm.into(),
        direction: Unit::new_normalize(direction),
        retract_to_mm: file.retract_to_mm,
        strand_pitch_mm: file.spacer_mm.map(|spacer| SEED_LENGTH_M * 1e3 + spacer),
        seeds,
    }
}
