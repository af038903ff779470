//! Results of a population study: one row per simulated insertion, in Parquet files that any program can query.
//!
//! The core writes them and the host reads them. Lengths in mm, patient frame (RAS); forces in N, times in s, strengths
//! in U.

#![warn(missing_docs)]

mod columns;
mod digest;
mod error;
mod folder;
mod read;
mod write;

pub use columns::MEASURED;
pub use digest::digest;
pub use error::TableError;
pub use folder::{FILE_ENDING, Shard, shard_files, structures_file};
pub use read::read;
pub use write::write;

/// One needle that was inserted or could not be.
#[derive(Clone, Debug, PartialEq)]
pub struct Insertion {
    /// `STUDY/SCENE/PLAN/IMPLANT/NEEDLE`; seeds all random numbers of the insertion.
    pub id: String,
    /// Name of the scene.
    pub scene: String,
    /// Name of the plan: its file name without extension.
    pub plan: String,
    /// Number of the implant in its scene and plan, from 1.
    pub implant: i32,
    /// Number of the needle in its plan, from 1.
    pub needle: i32,
    /// Hole of the template; empty if the plan names none.
    pub hole: String,
    /// Tissue model.
    pub tissue: String,
    /// Seed model, as in source files.
    pub source: String,
    /// Prescribed dose, Gy.
    pub prescription_gy: f64,
    /// Values drawn or set for this insertion, in the order of [`Table::quantities`].
    pub drawn: Vec<f64>,
    /// The result, or the reason why the insertion failed.
    pub outcome: Result<Motion, String>,
    /// Seeds in the order of the drops.
    pub seeds: Vec<Seed>,
}

/// Effect of an insertion on hand and tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Largest force on the hand, N.
    pub peak_force_n: f64,
    /// Largest displacement of an element before the first puncture, mm.
    pub displacement_before_puncture_mm: f64,
    /// Largest displacement of an element during the whole insertion, mm.
    pub largest_displacement_mm: f64,
    /// Largest shift of the target's centre during the whole insertion, mm.
    pub target_shift_mm: f64,
    /// Simulated duration, s.
    pub duration_s: f64,
}

/// One seed as planned and at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed {
    /// Planned position, mm.
    pub planned_mm: [f64; 3],
    /// Planned direction of its needle.
    pub planned_axis: [f64; 3],
    /// Air kerma strength, U.
    pub strength_u: f64,
    /// `None` if the insertion failed.
    pub rest: Option<Rest>,
}

/// A seed in tissue that has come to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// Its centre, mm.
    pub at_mm: [f64; 3],
    /// Its axis.
    pub axis: [f64; 3],
    /// Time of the drop after the tip's first contact with tissue, s.
    pub dropped_after_s: f64,
}

impl Seed {
    /// Distance from plan to rest, mm, and its component along the needle (positive: too deep).
    pub fn misplacement_mm(&self) -> Option<[f64; 2]> {
        let rest = self.rest?;
        let off = [0, 1, 2].map(|a| rest.at_mm[a] - self.planned_mm[a]);
        let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        Some([dot(off, off).sqrt(), dot(off, self.planned_axis)])
    }
}

/// Description of the study.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// Name of the study.
    pub study: String,
    /// SHA-256 of all inputs; files of different studies are not mixed.
    pub fingerprint: String,
    /// Contents of the study file.
    pub definition: String,
    /// Program and version.
    pub made_by: String,
}

/// Contents of one file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Description of the study.
    pub about: About,
    /// Columns of drawn values, such as `stiffness`; names include units.
    pub quantities: Vec<String>,
    /// Insertions.
    pub rows: Vec<Insertion>,
}

#[cfg(test)]
mod tests;
