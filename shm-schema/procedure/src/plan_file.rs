//! The file of a plan: its template and its needles with their seeds, mm, patient frame (RAS).

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_shm_schema::MAX_SEEDS;

const FORMAT: &str = "stylet plan, mm, RAS";
const MAX_NEEDLES: usize = 169;
/// Largest coordinate in a file.
const MAX_MM: f64 = 10_000.0;
/// Longest needle.
const LONGEST_MM: f64 = 500.0;

/// Contents of a plan file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanFile {
    /// [`PlanFile::FORMAT`].
    pub format: String,
    /// Model of the seeds.
    pub source: String,
    /// Prescribed dose.
    pub prescription_gy: f64,
    /// Template of the needles.
    pub template: TemplateFile,
    /// Needles in the order of their insertion.
    #[serde(default, rename = "needle")]
    pub needles: Vec<NeedleFile>,
}

/// A template: the place of its middle hole, and three unit vectors.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct TemplateFile {
    pub middle_hole_mm: [f64; 3],
    pub columns: [f64; 3],
    pub rows: [f64; 3],
    pub inwards: [f64; 3],
    pub pitch_mm: f64,
}

/// A needle; distances count from its entry.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NeedleFile {
    /// Hole of the template, where the needle is in one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hole: Option<String>,
    /// Place where its tip starts.
    pub entry_mm: [f64; 3],
    /// Unit vector into the body.
    pub direction: [f64; 3],
    /// Depth of the tip.
    pub depth_mm: f64,
    /// Place that the tip is drawn back to.
    #[serde(default)]
    pub retract_to_mm: f64,
    /// Spacer between the seeds of a strand; absent for loose seeds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spacer_mm: Option<f64>,
    /// Places of the seeds, deepest first.
    pub seed_along_mm: Vec<f64>,
    /// Strength of each seed.
    pub strength_u: Vec<f64>,
}

/// Problem of a plan file.
#[derive(Debug, thiserror::Error)]
pub enum PlanProblem {
    /// Another format, or another version of it.
    #[error("format is \"{0}\"; it must be \"{FORMAT}\"")]
    Format(String),
    /// More needles than a plan may have.
    #[error("{0} needles; at most {MAX_NEEDLES}")]
    TooManyNeedles(usize),
    /// More seeds than the core takes.
    #[error("{0} seeds; at most {MAX_SEEDS} can be placed")]
    TooManySeeds(usize),
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
    /// Problem of a needle.
    #[error("needle {number}: {problem}")]
    Needle {
        /// Number of the needle, from 1.
        number: usize,
        /// Its problem.
        problem: Box<PlanProblem>,
    },
}

impl PlanProblem {
    /// Returns the problem with so many seeds, if they are too many.
    pub fn of_seeds(count: usize) -> Option<Self> {
        (count > MAX_SEEDS).then_some(Self::TooManySeeds(count))
    }
}

impl PlanFile {
    /// Name and version of the format.
    pub const FORMAT: &str = FORMAT;

    /// Returns every problem of the file.
    pub fn problems(&self) -> Vec<PlanProblem> {
        let mut found = Problems(Vec::new());
        if self.format != Self::FORMAT {
            found.0.push(PlanProblem::Format(self.format.clone()));
        }
        found.range("prescription_gy", self.prescription_gy, 1e-3, 1e4);
        let t = &self.template;
        found.place("template: middle_hole_mm", t.middle_hole_mm);
        found.direction("template: columns", t.columns);
        found.direction("template: rows", t.rows);
        found.direction("template: inwards", t.inwards);
        found.range("template: pitch_mm", t.pitch_mm, 1.0, 20.0);
        if self.needles.len() > MAX_NEEDLES {
            found.0.push(PlanProblem::TooManyNeedles(self.needles.len()));
        }
        let seeds = self.needles.iter().map(|needle| needle.seed_along_mm.len()).sum();
        found.0.extend(PlanProblem::of_seeds(seeds));
        for (number, needle) in (1..).zip(&self.needles) {
            let boxed = needle.problems().into_iter().map(Box::new);
            found
                .0
                .extend(boxed.map(|problem| PlanProblem::Needle { number, problem }));
        }
        found.0
    }
}

impl NeedleFile {
    fn problems(&self) -> Vec<PlanProblem> {
        let mut found = Problems(Vec::new());
        found.place("entry_mm", self.entry_mm);
        found.direction("direction", self.direction);
        found.range("depth_mm", self.depth_mm, 0.0, LONGEST_MM);
        found.range("retract_to_mm", self.retract_to_mm, 0.0, LONGEST_MM);
        if let Some(spacer_mm) = self.spacer_mm {
            found.range("spacer_mm", spacer_mm, 0.1, 50.0);
        }
        let (places, strengths) = (self.seed_along_mm.len(), self.strength_u.len());
        if places != strengths {
            found.0.push(PlanProblem::Strengths { places, strengths });
        }
        for &along_mm in &self.seed_along_mm {
            found.range("seed_along_mm", along_mm, 0.0, LONGEST_MM);
        }
        for &strength_u in &self.strength_u {
            found.range("strength_u", strength_u, 0.0, 1e5);
        }
        found.0
    }
}

struct Problems(Vec<PlanProblem>);

// NaN is in no range.
impl Problems {
    fn range(&mut self, key: &'static str, value: f64, least: f64, most: f64) {
        if !(least..=most).contains(&value) {
            self.0.push(PlanProblem::Range {
                key,
                value,
                least,
                most,
            });
        }
    }

    fn place(&mut self, key: &'static str, mm: [f64; 3]) {
        if !mm.iter().all(|c| c.abs() <= MAX_MM) {
            self.0.push(PlanProblem::Place { key, mm });
        }
    }

    fn direction(&mut self, key: &'static str, axis: [f64; 3]) {
        if !(0.999..1.001).contains(&Vector3::from(axis).norm()) {
            self.0.push(PlanProblem::Direction { key, axis });
        }
    }
}
