//! Robustness of the coverage against misplaced seeds: trials with every seed moved at random.

use crate::plan::anatomy::Body;
use crate::plan::dose::perturb::{Perturbation, moved};
use crate::plan::dose::{DoseKernel, DosePoints, Dvh, Seed};
use rayon::prelude::*;

/// Pitch of the points, coarse, because the spread of trials is wider than their error.
const PITCH_M: f64 = 3e-3;
/// D90 to be kept, as a share of the prescription.
const KEPT: f64 = 0.9;
/// Reserve of a search over the requested share of the trials: its own trials are few, and others
/// differ by 1.3 % (standard deviation of 95 % of 300).
const AIMED_ABOVE: f64 = 0.02;

/// D90 that must be at least 90 % of the prescription.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Statistic {
    /// D90 of the plan alone; its robustness is only reported.
    Planned,
    /// Mean D90 of the trials.
    Expected,
    /// D90 that this share of the trials reaches, such as 0.9 for the tenth percentile.
    KeptBy(f64),
}

impl Statistic {
    /// Usual choice: 95 % of the trials keep it.
    pub const USUAL: Self = Self::KeptBy(0.95);

    /// Returns the largest expected cold share of the target, for the start of a search.
    pub(super) fn cold(self) -> Option<f32> {
        match self {
            Self::Planned => None,
            Self::Expected => Some(0.09),
            Self::KeptBy(share) => Some(if share > 0.92 { 0.04 } else { 0.055 }),
        }
    }
}

/// D90 of trials in Gy, lowest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Trials {
    d90_gy: Vec<f64>,
}

impl Trials {
    /// Moves seeds and computes the dose of the target for each trial. Seeds with the same number
    /// in `needles` may share their errors; seeds in the tissue stay.
    pub fn new(
        target: &Body,
        kernel: &DoseKernel,
        (seeds, needles): (&[Seed], &[usize]),
        present: &[Seed],
        how: Perturbation,
    ) -> Self {
        let target = target.structure(PITCH_M);
        let mut points = DosePoints::new(&target.points_m);
        points.add(kernel, present);
        let d90_gy = |trial: usize| {
            let mut gy = points.of_seeds_gy(kernel, &moved(seeds, needles, how, trial));
            gy.iter_mut()
                .zip(points.dose_gy())
                .for_each(|(gy, of_present)| *gy += of_present);
            let dvh = Dvh::new(&gy, &target.volumes_m3)?;
            dvh.dose_of_gy(0.9 * dvh.volume_m3())
        };
        let mut d90_gy: Vec<f64> = (0..how.trials).into_par_iter().filter_map(d90_gy).collect();
        d90_gy.sort_by(f64::total_cmp);
        Self { d90_gy }
    }

    /// Returns the share of the trials whose D90 is at least 90 % of the prescription.
    pub fn kept(&self, prescription_gy: f64) -> f64 {
        let below = self.d90_gy.partition_point(|gy| *gy < KEPT * prescription_gy);
        1.0 - below as f64 / self.d90_gy.len().max(1) as f64
    }

    /// Returns the mean D90, Gy; 0 without a trial.
    pub fn expected_gy(&self) -> f64 {
        self.d90_gy.iter().sum::<f64>() / self.d90_gy.len().max(1) as f64
    }

    /// Returns the D90 that a share of the trials reaches, Gy; `None` without a trial.
    pub fn kept_by_gy(&self, share: f64) -> Option<f64> {
        self.d90_gy
            .get(((1.0 - share) * self.d90_gy.len() as f64) as usize)
            .copied()
    }

    /// Returns the requested D90 with the reserve of a search, Gy; `None` if nothing is required.
    fn asked_gy(&self, which: Statistic) -> Option<f64> {
        match which {
            Statistic::Planned => None,
            Statistic::Expected => Some(self.expected_gy()),
            Statistic::KeptBy(share) => Some(self.kept_by_gy((share + AIMED_ABOVE).min(1.0)).unwrap_or(0.0)),
        }
    }

    /// Returns the distance of the requested D90 below 90 % of the prescription, as a share of that;
    /// 0 if it is not below.
    pub fn shortfall(&self, which: Statistic, prescription_gy: f64) -> f64 {
        let short = |gy: f64| (1.0 - gy / (KEPT * prescription_gy)).max(0.0);
        self.asked_gy(which).map_or(0.0, short)
    }

    /// Returns the factor of the strength that gives the requested D90, with a small reserve;
    /// `None` if nothing is required or without dose.
    pub fn strengthening(&self, which: Statistic, prescription_gy: f64) -> Option<f64> {
        Some(KEPT * prescription_gy / self.asked_gy(which).filter(|gy| *gy > 0.0)?)
    }
}
