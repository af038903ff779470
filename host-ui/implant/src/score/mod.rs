//! What an implant was worth: every seed's error and what it cost in dose, the measures of planned and delivered dose, and how the
//! hand moved.

mod dose_cost;
mod motion;
mod outline;
mod page;
mod picture;
mod trace;
mod updates;
mod write;

use crate::intraoperative::Reviewed;
use crate::pairing::SeedOffset;
use crate::plan::{Anatomy, Hole};
pub use dose_cost::{Cost, costs};
pub use motion::Motion;
pub use page::STYLE;
use stylet_dose::report::{Judge, Verdict};
use stylet_dose::{DoseKernel, Seed};
use stylet_host::moments::Moment;
use stylet_shm_schema::TickRecord;
pub use trace::Trace;
pub use write::{to_json, write};

const DOSE_PITCH_M: f64 = 1e-3;
const POINTS: usize = 100_000;

/// One seed, planned and delivered, scene frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeedPair {
    /// Counted from 0.
    pub needle: usize,
    /// Hole of the needle; `None` for one that is held by hand.
    pub hole: Option<Hole>,
    /// The seed as planned.
    pub planned: Seed,
    /// The seed as it rests in the tissue.
    pub delivered: Seed,
    /// Of the needle, into the body.
    pub direction: [f64; 3],
}

impl SeedPair {
    /// How far the delivered seed rests from the planned one.
    pub fn offset(&self) -> SeedOffset {
        SeedOffset::of(self.planned.position_m, self.delivered.position_m, self.direction)
    }

    /// Distance from plan, m.
    pub fn error_m(&self) -> f64 {
        self.offset().distance_m()
    }

    /// Distance along the needle, m; positive: deeper than planned.
    pub fn error_along_m(&self) -> f64 {
        self.offset().along_m
    }

    /// Distance across the needle, m.
    pub fn error_across_m(&self) -> f64 {
        self.offset().across_m
    }
}

/// Why an implant cannot be scored, or its score not be written.
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// There is nothing to score.
    #[error("no seed was placed; there is nothing to score")]
    NoSeed,
    /// The dose cannot be counted; the text says why.
    #[error("{0}")]
    Dose(String),
    /// The drawing library failed.
    #[error("a picture of the debrief cannot be drawn ({0})")]
    Picture(String),
    /// A figure is not representable in JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] stylet_base::WriteError),
}

/// What is scored.
pub struct Implant<'a> {
    /// Heading of the page.
    pub title: String,
    /// The seeds that were delivered.
    pub pairs: Vec<SeedPair>,
    /// Planned, and not delivered.
    pub lost: Vec<Seed>,
    /// Target and what is spared.
    pub anatomy: &'a Anatomy,
    /// Dose of one seed.
    pub kernel: &'a DoseKernel,
    /// As the source file names itself.
    pub source: String,
    /// Prescribed dose, Gy.
    pub prescription_gy: f64,
    /// How the hand moved.
    pub motion: Motion,
    /// Force and speed over time; every tick or some of them.
    pub records: &'a [TickRecord],
    /// What was marked, put in by an instructor, or went wrong meanwhile.
    pub moments: Vec<Moment>,
    /// Updates of the plan while needles went in, taken or not.
    pub updates: Vec<Reviewed>,
}

/// The result.
pub struct Score<'a> {
    /// What was scored.
    pub implant: Implant<'a>,
    /// The structures that dose was counted in.
    pub judge: Judge,
    /// Measures of the plan.
    pub planned: Verdict,
    /// Measures of the implant as delivered.
    pub delivered: Verdict,
    /// In the order of the pairs.
    pub costs: Vec<Cost>,
}

impl<'a> Score<'a> {
    /// Scores an implant; an error when there is no seed, or no dose can be counted.
    pub fn of(implant: Implant<'a>) -> Result<Self, ScoreError> {
        if implant.pairs.is_empty() {
            return Err(ScoreError::NoSeed);
        }
        let seeds = |one: fn(&SeedPair) -> Seed| implant.pairs.iter().map(one).collect::<Vec<_>>();
        let (on_plan, delivered) = (seeds(|p| p.planned), seeds(|p| p.delivered));
        let planned = [on_plan.clone(), implant.lost.clone()].concat();
        let structures = implant.anatomy.structures(DOSE_PITCH_M);
        let target = implant.anatomy.target.name.clone();
        let costs = costs(
            &structures,
            implant.kernel,
            implant.prescription_gy,
            &on_plan,
            &delivered,
        );
        let all = [planned.clone(), delivered.clone()].concat();
        let judge = Judge::new(structures, Some(&target), &[], implant.prescription_gy, &all, POINTS)
            .map_err(|e| ScoreError::Dose(e.to_string()))?;
        Ok(Self {
            planned: judge.judge(implant.kernel, &planned),
            delivered: judge.judge(implant.kernel, &delivered),
            judge,
            costs,
            implant,
        })
    }

    /// When a moment was, from the first record on, s.
    pub fn at_s(&self, moment: &Moment) -> f64 {
        let begin_ns = self.implant.records.first().map_or(moment.time_ns, |r| r.due_ns);
        (moment.time_ns as f64 - begin_ns as f64) * 1e-9
    }

    /// Mean and worst error of the seeds.
    pub fn errors_m(&self) -> [f64; 2] {
        let errors = || self.implant.pairs.iter().map(SeedPair::error_m);
        let mean = errors().sum::<f64>() / self.implant.pairs.len() as f64;
        [mean, errors().fold(0.0, f64::max)]
    }
}

#[cfg(test)]
mod tests;
