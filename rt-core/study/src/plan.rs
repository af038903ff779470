//! The needles of a plan file, as far as insertions need them.

use nalgebra::{Unit, Vector3};
use stylet_procedure::{NeedleFile, PlanFile};
use stylet_shm_schema::{ProblemList, SEED_LENGTH_M};

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
    /// Problem of its contents.
    #[error(transparent)]
    File(#[from] stylet_procedure::PlanProblem),
    /// No needle.
    #[error("it has no needle")]
    NoNeedle,
    /// A needle without a seed.
    #[error("needle {0}: it has no seed, and an insertion ends with its last seed: leave the needle out")]
    NoSeed(usize),
}

/// Reads a plan, or lists every problem with it.
pub fn of_text(text: &str) -> Result<Plan, ProblemList<PlanProblem>> {
    let file: PlanFile = toml::from_str(text).map_err(PlanProblem::from)?;
    let mut problems: Vec<PlanProblem> = file.problems().into_iter().map(PlanProblem::from).collect();
    if file.needles.is_empty() {
        problems.push(PlanProblem::NoNeedle);
    }
    let numbered = (1..).zip(&file.needles);
    let empty = numbered.filter(|(_, needle)| needle.seed_along_mm.is_empty());
    problems.extend(empty.map(|(number, _)| PlanProblem::NoSeed(number)));
    ProblemList::check(problems)?;
    Ok(Plan {
        source: file.source,
        prescription_gy: file.prescription_gy,
        needles: file.needles.into_iter().map(needle).collect(),
    })
}

fn needle(file: NeedleFile) -> Needle {
    let mut seeds: Vec<(f64, f64)> = file.seed_along_mm.into_iter().zip(file.strength_u).collect();
    seeds.sort_by(|a, b| b.0.total_cmp(&a.0));
    Needle {
        hole: file.hole.unwrap_or_default(),
        entry_mm: file.entry_mm.into(),
        direction: Unit::new_normalize(file.direction.into()),
        retract_to_mm: file.retract_to_mm,
        strand_pitch_mm: file.spacer_mm.map(|spacer| SEED_LENGTH_M * 1e3 + spacer),
        seeds,
    }
}
