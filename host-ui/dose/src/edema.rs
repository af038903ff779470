//! Dose in a gland that swells at the implant and shrinks again, together with its seeds.
//!
//! The volume is `V(t) = V_end (1 + M exp(-λ_e t))` from the implant on, and every distance in it
//! grows with the cube root (Chen, Yue, Wang, Roberts, Peschel, Nath, Int. J. Radiat. Oncol. 47,
//! 1405, 2000; AAPM TG-137, 2009). The dose to a piece of tissue is the integral of its dose rate
//! in the geometry of each moment. With `u = exp(-λ t)` it is the mean over u of the total dose in
//! the geometry of that moment: a sum of doses at a few moments (Gauss and Legendre in the root of
//! u).

use super::decay::{days_to_s, s_to_days};
use super::kernel::DoseKernel;
use super::points::DosePoints;
use super::seed::Seed;

/// Nodes and weights of Gauss and Legendre from -1 to 1, the positive half.
const NODES: [[f64; 2]; 6] = [
    [0.125_233_408_511_469, 0.249_147_045_813_403],
    [0.367_831_498_998_180, 0.233_492_536_538_355],
    [0.587_317_954_286_617, 0.203_167_426_723_066],
    [0.769_902_674_194_305, 0.160_078_328_543_346],
    [0.904_117_256_370_475, 0.106_939_325_995_318],
    [0.981_560_634_246_719, 0.047_175_336_386_512],
];

/// Swelling of a gland at the implant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edema {
    /// Volume gained at the implant, as a share of the final volume: 0.5 for half as much again.
    pub magnitude: f64,
    /// Time in which half of the gain is lost, in s.
    pub half_life_s: f64,
}

/// Swelling of a gland that was imaged without it, and the source whose dose it changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swelling {
    /// The swelling.
    pub edema: Edema,
    /// Half-life of the source, in s.
    pub half_life_s: f64,
}

impl Swelling {
    /// Computes the dose of seeds at points, both as in the gland without edema (Gy); `kernel` is
    /// for all time.
    pub fn dose_gy(self, kernel: &DoseKernel, seeds: &[Seed], points: &DosePoints) -> Vec<f64> {
        self.edema
            .dose_gy(kernel, self.half_life_s, f64::INFINITY, seeds, points)
    }
}

impl Edema {
    /// Creates an edema from a half-life in days.
    pub fn of_days(magnitude: f64, half_life_days: f64) -> Self {
        Self {
            magnitude,
            half_life_s: days_to_s(half_life_days),
        }
    }

    /// Returns the stretch of distances some time after the implant, relative to the final ones.
    pub fn stretch(self, after_s: f64) -> f64 {
        (1.0 + self.magnitude * (-after_s / self.half_life_s).exp2()).cbrt()
    }

    /// Returns moments, in half-lives of the source turned into s, each with the share of the whole
    /// dose that its geometry gives.
    fn moments(half_life_s: f64) -> impl Iterator<Item = (f64, f64)> {
        let both = NODES.into_iter().flat_map(|[x, weight]| [(x, weight), (-x, weight)]);
        both.map(move |(x, weight)| {
            // u = v², v from 0 to 1.
            let v = (1.0 + x) / 2.0;
            (-v.powi(2).log2() * half_life_s, weight * v)
        })
    }

    /// Computes the total dose of seeds at points (Gy), both at their positions `seen_s` after the
    /// implant; `kernel` is for all time.
    pub fn dose_gy(
        self,
        kernel: &DoseKernel,
        half_life_s: f64,
        seen_s: f64,
        seeds: &[Seed],
        points: &DosePoints,
    ) -> Vec<f64> {
        let seen = self.stretch(seen_s);
        let mut dose_gy = vec![0.0; points.dose_gy().len()];
        for (after_s, share) in Self::moments(half_life_s) {
            let by = self.stretch(after_s) / seen;
            let seed = |s: &Seed| Seed {
                strength_u: s.strength_u * share,
                ..*s
            };
            let seeds: Vec<Seed> = seeds.iter().map(seed).collect();
            let of_moment = points.of_seeds_stretched_gy(kernel, &seeds, by);
            dose_gy.iter_mut().zip(of_moment).for_each(|(sum, gy)| *sum += gy);
        }
        dose_gy
    }
}

impl std::fmt::Display for Edema {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let days = s_to_days(self.half_life_s);
        write!(
            f,
            "{:.0} % of the volume, half-life {days:.1} days",
            self.magnitude * 100.0
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;
    use crate::decay::Interval;

    /// Source that radiates as a point, as 1/r² alone.
    const PLAIN: &str = "[source]\nmodel = \"plain\"\nnuclide = \"I-125\"\nhalf_life_days = 59.4\ndose_rate_constant = 1.0\n\
        active_length_cm = 0.0\nr0_cm = 1.0\ntheta0_deg = 90.0\n[radial]\nr_cm = [0.1, 1.0, 20.0]\ng_point = [1.0, 1.0, 1.0]\n\
        [anisotropy_1d]\nr_cm = [0.5, 5.0]\nphi_an = [1.0, 1.0]\n";
    const POINTS_M: [[f64; 3]; 3] = [[0.008, 0.0, 0.0], [-0.004, 0.012, 0.001], [-0.004, -0.012, -0.001]];

    fn doses(edema: Edema, seen_days: f64) -> (Vec<f64>, Vec<f64>) {
        let source = Source::parse(PLAIN).unwrap();
        let kernel = DoseKernel::new(&source, Interval::ALL);
        let seeds = [Seed {
            position_m: [-0.001, 0.001, 0.002],
            axis: None,
            strength_u: 0.5,
        }];
        let points = DosePoints::new(&POINTS_M);
        let moving = edema.dose_gy(&kernel, source.half_life_s, days_to_s(seen_days), &seeds, &points);
        (moving, points.of_seeds_gy(&kernel, &seeds))
    }

    /// Returns the dose relative to that of the final geometry: the sum over n of C(-2/3, n) Mⁿ /
    /// (1 + n T/Tₑ), which converges for M < 1.
    fn series(magnitude: f64, ratio: f64) -> f64 {
        let (mut sum, mut term) = (0.0, 1.0);
        for n in 0..400 {
            sum += term / (1.0 + f64::from(n) * ratio);
            term *= magnitude * (-2.0 / 3.0 - f64::from(n)) / f64::from(n + 1);
        }
        sum
    }

    #[test]
    fn without_edema_the_dose_is_that_of_plain_decay() {
        let (moving, still) = doses(Edema::of_days(0.0, 10.0), 0.0);
        for (moving, still) in moving.iter().zip(&still) {
            assert!((moving / still - 1.0).abs() < 1e-6, "{moving} {still}");
        }
    }

    /// Compares with closed forms for a seed and a point that radiate as 1/r². For equal half-lives
    /// the ratio is 3 ((1 + M)^(1/3) - 1) / M.
    #[test]
    fn the_dose_of_a_swelling_gland_matches_the_closed_form() {
        for (magnitude, days) in [(0.5, 59.4), (0.5, 9.3), (0.8, 25.0), (0.3, 4.0), (0.95, 200.0)] {
            let edema = Edema::of_days(magnitude, days);
            let (moving, seen) = doses(edema, 0.0);
            // The geometry of the first day is stretched: in the final one the dose is larger.
            let in_end = edema.stretch(0.0).powi(2);
            let expected = series(magnitude, 59.4 / days);
            if days == 59.4 {
                assert!((expected - 3.0 * ((1.0 + magnitude).cbrt() - 1.0) / magnitude).abs() < 1e-9);
            }
            for (moving, seen) in moving.iter().zip(&seen) {
                let ratio = moving / (seen * in_end);
                assert!(
                    (ratio / expected - 1.0).abs() < 2e-4,
                    "{magnitude} {days}: {ratio} {expected}"
                );
            }
        }
    }
}
