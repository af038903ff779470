//! Mean and variance of a misplaced seed's dose at points of the target.
//!
//! The errors of two seeds are independent in the search, so that both add up over the seeds.
//! Common errors of seeds of one strand or one implant are counted by the trials that judge a plan
//! ([`super::robust`]).

use crate::plan::dose::perturb::{Perturbation, moved};
use crate::plan::dose::{DoseKernel, DosePoints, Seed};

/// Number of drawn errors of a seed; all places share them.
const DRAWS: usize = 32;
/// Share of the prescription beyond which a seed's dose does not matter to a cold point: the dose
/// near a seed is far from a normal distribution.
const MOST: f64 = 0.6;

/// Points, and the errors of a seed.
pub struct Misplaced {
    points: DosePoints,
    errors: Vec<Option<Seed>>,
    prescription_gy: f64,
    /// Largest dose of 1 U that counts, Gy.
    most_gy: f64,
}

impl Misplaced {
    /// Prepares points for seeds along `axis`, of a strength of about `usual_u`.
    pub fn new(
        points_m: &[[f64; 3]],
        how: Perturbation,
        (prescription_gy, usual_u): (f64, f64),
        axis: [f64; 3],
    ) -> Self {
        let seed = Seed {
            position_m: [0.0; 3],
            axis: Some(axis),
            strength_u: 1.0,
        };
        // A lost seed has no dose.
        let error = |trial: usize| moved(&[seed], &[], how, trial).first().copied();
        Self {
            points: DosePoints::new(points_m),
            errors: (0..DRAWS).map(error).collect(),
            prescription_gy,
            most_gy: MOST * prescription_gy / usual_u,
        }
    }

    /// Writes mean and variance of the dose of 1 U at a place to a row: first the means of all
    /// points, then the variances, as shares of the prescription and of its square.
    pub fn moments(&self, kernel: &DoseKernel, place_m: [f64; 3], row: &mut Vec<f32>) {
        let count = self.points.dose_gy().len();
        let (mut sum, mut squares) = (vec![0.0; count], vec![0.0; count]);
        for error in self.errors.iter().flatten() {
            let seed = Seed {
                position_m: [0, 1, 2].map(|a| place_m[a] + error.position_m[a]),
                ..*error
            };
            for (n, gy) in self.points.of_seeds_gy(kernel, &[seed]).into_iter().enumerate() {
                let share = gy.min(self.most_gy) / self.prescription_gy;
                sum[n] += share;
                squares[n] += share * share;
            }
        }
        let draws = DRAWS as f64;
        row.extend(sum.iter().map(|sum| (sum / draws) as f32));
        let variance = |(sum, squares): (&f64, &f64)| ((squares - sum * sum / draws) / (draws - 1.0)).max(0.0) as f32;
        row.extend(sum.iter().zip(&squares).map(variance));
    }
}
