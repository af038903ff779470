//! What is left of the coverage when seeds miss their places: trials with every seed moved at random.

use crate::plan::anatomy::Body;
use crate::plan::dose::perturb::{Perturbation, moved};
use crate::plan::dose::{DoseKernel, DosePoints, Dvh, Seed};

/// Coarse is enough: the spread of trials is wider than the error of the points.
const PITCH_M: f64 = 3e-3;
/// The D90 that a trial should keep, as a share of the prescription.
const KEPT: f64 = 0.9;
/// The trials that should keep it.
pub const TRIALS_KEPT: f64 = 0.95;

/// The trials that a search aims at.
const TRIALS_AIM: f64 = 0.97;

/// D90 of trials in Gy, lowest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Trials {
    d90_gy: Vec<f64>,
}

impl Trials {
    /// Moves seeds and computes the dose of the target for each trial.
    pub fn new(target: &Body, kernel: &DoseKernel, seeds: &[Seed], how: Perturbation) -> Self {
        let target = target.structure(PITCH_M);
        let points = DosePoints::new(&target.points_m);
        let d90_gy = |trial: usize| {
            let gy = points.of_seeds_gy(kernel, &moved(seeds, &[], how, trial));
            let dvh = Dvh::new(&gy, &target.volumes_m3)?;
            dvh.dose_of_gy(0.9 * dvh.volume_m3())
        };
        let mut d90_gy: Vec<f64> = (0..how.trials).filter_map(d90_gy).collect();
        d90_gy.sort_by(f64::total_cmp);
        Self { d90_gy }
    }

    /// Share of the trials whose D90 is at least 90 % of the prescription.
    pub fn kept(&self, prescription_gy: f64) -> f64 {
        let below = self.d90_gy.partition_point(|gy| *gy < KEPT * prescription_gy);
        1.0 - below as f64 / self.d90_gy.len().max(1) as f64
    }

    /// So many times the strength let 97 % of the trials keep it, a few more than needed; `None` without dose.
    pub fn strengthening(&self, prescription_gy: f64) -> Option<f64> {
        let at = ((1.0 - TRIALS_AIM) * self.d90_gy.len() as f64) as usize;
        let gy = self.d90_gy.get(at).filter(|gy| **gy > 0.0)?;
        Some(KEPT * prescription_gy / gy)
    }
}
