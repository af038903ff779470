//! Score of an implant: every seed's error and its cost in dose, the measures of planned and
//! delivered dose, and the motion of the hand.

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
use stylet_dose::report::{Judge, Verdict};
use stylet_dose::{DoseError, DoseKernel, Seed};
use stylet_host::moments::Moment;
use stylet_report::picture::DrawError;
use stylet_shm_schema::{SeedPose, TickRecord, touching};
pub use trace::Trace;
pub use write::{files, to_json, write};

const POINTS: usize = 100_000;

/// Seed, planned and delivered, scene frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeedPair {
    /// Index of the needle, from 0.
    pub needle: usize,
    /// Hole of the needle; `None` for one that is held by hand.
    pub hole: Option<Hole>,
    /// Planned seed, with the direction of the needle, into the body.
    pub planned: Seed,
    /// Delivered seed at rest.
    pub delivered: Seed,
}

impl SeedPair {
    /// Creates the pair of a planned seed and the one that was dropped for it.
    pub fn new((needle, hole): (usize, Option<Hole>), planned: Seed, pose: &SeedPose) -> Self {
        let delivered = seed_of(pose, planned.strength_u);
        Self {
            needle,
            hole,
            planned,
            delivered,
        }
    }

    /// Returns the offset of the delivered seed from the planned one.
    pub fn offset(&self) -> SeedOffset {
        let direction = self.planned.axis.unwrap_or_default();
        SeedOffset::of(self.planned.position_m, self.delivered.position_m, direction)
    }

    /// Returns the distance from plan, m.
    pub fn error_m(&self) -> f64 {
        self.offset().distance_m()
    }
}

/// Returns a seed in the tissue as one for dose.
pub fn seed_of(pose: &SeedPose, strength_u: f64) -> Seed {
    Seed {
        position_m: pose.position_m,
        axis: Some(pose.axis),
        strength_u,
    }
}

/// Reason why an implant cannot be scored, or its score cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// There is nothing to score.
    #[error("no seed was placed; there is nothing to score")]
    NoSeed,
    /// The dose cannot be computed.
    #[error(transparent)]
    Dose(#[from] DoseError),
    /// The drawing library failed.
    #[error("the debrief: {0}")]
    Picture(#[from] DrawError),
    /// A figure is not representable in JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] stylet_base::WriteError),
}

/// Input of a score.
pub struct Implant<'a> {
    /// Heading of the page.
    pub title: String,
    /// The seeds that were delivered.
    pub pairs: Vec<SeedPair>,
    /// Planned seeds that were not delivered.
    pub lost: Vec<Seed>,
    /// Seeds in the tissue without a planned one; they count in the delivered dose.
    pub unplanned: Vec<Seed>,
    /// Target and spared structures.
    pub anatomy: &'a Anatomy,
    /// Dose of one seed.
    pub kernel: &'a DoseKernel,
    /// Name of the source, as in its file.
    pub source: String,
    /// Prescribed dose, Gy.
    pub prescription_gy: f64,
    /// Motion of the hand.
    pub motion: Motion,
    /// Force and speed over time; every tick or some of them.
    pub records: &'a [TickRecord],
    /// Marks, exercises and faults during the procedure.
    pub moments: Vec<Moment>,
    /// Updates of the plan while needles went in, accepted or not.
    pub updates: Vec<Reviewed>,
}

/// The result.
pub struct Score<'a> {
    /// Scored implant.
    pub implant: Implant<'a>,
    /// Structures in which dose was counted.
    pub judge: Judge,
    /// Measures of the plan.
    pub planned: Verdict,
    /// Measures of the implant as delivered.
    pub delivered: Verdict,
    /// Costs in the order of the pairs.
    pub costs: Vec<Cost>,
}

impl<'a> Score<'a> {
    /// Returns the numbers, from 1, of the seeds that each one touches, in the order of the pairs.
    pub fn touching(&self) -> Vec<Vec<usize>> {
        let pose = |pair: &SeedPair| SeedPose {
            position_m: pair.delivered.position_m,
            axis: pair.delivered.axis.unwrap_or_default(),
            dropped_at_m: pair.planned.position_m,
        };
        let poses: Vec<SeedPose> = self.implant.pairs.iter().map(pose).collect();
        (0..poses.len()).map(|number| touching(&poses, number)).collect()
    }

    /// Scores an implant; returns an error if there is no seed, or the dose cannot be computed.
    pub fn of(implant: Implant<'a>) -> Result<Self, ScoreError> {
        if implant.pairs.is_empty() {
            return Err(ScoreError::NoSeed);
        }
        let seeds = |one: fn(&SeedPair) -> Seed| implant.pairs.iter().map(one).collect::<Vec<_>>();
        let (on_plan, mut delivered) = (seeds(|p| p.planned), seeds(|p| p.delivered));
        delivered.extend_from_slice(&implant.unplanned);
        let planned = [on_plan.clone(), implant.lost.clone()].concat();
        let structures = implant.anatomy.structures();
        let target = implant.anatomy.target.name.clone();
        let costs = costs(
            &structures,
            implant.kernel,
            implant.prescription_gy,
            &on_plan,
            &delivered,
        );
        let all = [planned.clone(), delivered.clone()].concat();
        let judge = Judge::new(structures, Some(&target), &[], implant.prescription_gy, &all, POINTS)?;
        Ok(Self {
            planned: judge.judge(implant.kernel, &planned),
            delivered: judge.judge(implant.kernel, &delivered),
            judge,
            costs,
            implant,
        })
    }

    /// Returns the number of seeds in the tissue.
    pub fn seeds(&self) -> usize {
        self.implant.pairs.len() + self.implant.unplanned.len()
    }

    /// Returns whether all seeds are of one needle, whose dose has no limits to meet.
    pub fn is_one_needle(&self) -> bool {
        let pairs = &self.implant.pairs;
        pairs.iter().all(|pair| pair.needle == pairs[0].needle)
    }

    /// Returns the time of a moment since the first record, s.
    pub fn at_s(&self, moment: &Moment) -> f64 {
        let begin_ns = self.implant.records.first().map_or(moment.time_ns, |r| r.due_ns);
        (moment.time_ns as f64 - begin_ns as f64) * 1e-9
    }

    /// Returns mean and largest error of the seeds.
    pub fn errors_m(&self) -> [f64; 2] {
        let errors = || self.implant.pairs.iter().map(SeedPair::error_m);
        let mean = errors().sum::<f64>() / self.implant.pairs.len() as f64;
        [mean, errors().fold(0.0, f64::max)]
    }
}

#[cfg(test)]
mod tests;
