//! The needles of a plan file, as far as insertions need them; `host-ui` writes such files and checks all of them.

use crate::error::Problems;
use nalgebra::{Unit, Vector3};
use serde::Deserialize;
use stylet_shm_schema::MAX_SEEDS;

const FORMAT: &str = "stylet plan, mm, RAS";
/// Length from end to end of a seed; with a spacer the pitch of a strand.
const SEED_LENGTH_MM: f64 = 4.5;
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

/// Reads a plan, or lists what is wrong with it.
pub fn of_text(text: &str) -> Result<Plan, Problems> {
    let file: PlanFile = toml::from_str(text).map_err(|e| Problems(vec![format!("it is no plan of host-ui: {e}")]))?;
    let mut problems = Vec::new();
    if file.format != FORMAT {
        problems.push(format!("format is \"{}\"; it must be \"{FORMAT}\"", file.format));
    }
    if !(1e-3..=1e4).contains(&file.prescription_gy) {
        problems.push(format!(
            "prescription_gy is {}; it must be 0.001 to 10000",
            file.prescription_gy
        ));
    }
    if file.needles.is_empty() {
        problems.push("it has no needle".to_owned());
    }
    let needles = file.needles.into_iter().enumerate().map(|(n, needle)| {
        let mut found = Vec::new();
        let needle = checked(needle, &mut found);
        problems.extend(found.into_iter().map(|what| format!("needle {}: {what}", n + 1)));
        needle
    });
    let needles = needles.collect();
    if !problems.is_empty() {
        return Err(Problems(problems));
    }
    Ok(Plan {
        source: file.source,
        prescription_gy: file.prescription_gy,
        needles,
    })
}

fn checked(file: NeedleFile, problems: &mut Vec<String>) -> Needle {
    let direction = Vector3::from(file.direction);
    // NaN compares false.
    if !file.entry_mm.iter().all(|c| c.abs() <= FARTHEST_MM) {
        problems.push(format!(
            "entry_mm is {:?}; coordinates must be within {FARTHEST_MM} mm",
            file.entry_mm
        ));
    }
    if !(0.999..1.001).contains(&direction.norm()) {
        problems.push(format!("direction is {:?}, no unit vector", file.direction));
    }
    if !(0.0..=LONGEST_MM).contains(&file.retract_to_mm) {
        problems.push(format!(
            "retract_to_mm is {}; it must be 0 to {LONGEST_MM}",
            file.retract_to_mm
        ));
    }
    if let Some(spacer) = file.spacer_mm.filter(|s| !(0.1..=50.0).contains(s)) {
        problems.push(format!("spacer_mm is {spacer}; it must be 0.1 to 50"));
    }
    let (places, strengths) = (file.seed_along_mm, file.strength_u);
    if places.len() != strengths.len() {
        problems.push(format!(
            "{} seeds in seed_along_mm and {} in strength_u",
            places.len(),
            strengths.len()
        ));
    }
    if places.len() > MAX_SEEDS {
        problems.push(format!("{} seeds; at most {MAX_SEEDS}", places.len()));
    }
    if places.is_empty() {
        problems.push("it has no seed, and an insertion ends with its last seed: leave the needle out".to_owned());
    }
    for along in places.iter().filter(|a| !(0.0..=LONGEST_MM).contains(*a)) {
        problems.push(format!("seed_along_mm has {along}; it must be 0 to {LONGEST_MM}"));
    }
    let mut seeds: Vec<(f64, f64)> = places.into_iter().zip(strengths).collect();
    seeds.sort_by(|a, b| b.0.total_cmp(&a.0));
    Needle {
        hole: file.hole,
        entry_mm: file.entry_mm.into(),
        direction: Unit::new_normalize(direction),
        retract_to_mm: file.retract_to_mm,
        strand_pitch_mm: file.spacer_mm.map(|spacer| SEED_LENGTH_MM + spacer),
        seeds,
    }
}
