//! Gamma index of two doses (Low et al., Med. Phys. 25, 656, 1998): smallest combined difference in
//! place and dose.

use rayon::prelude::*;

/// Largest gamma of the search; it means "2 or more".
pub const HIGHEST: f64 = 2.0;
/// Steps of the search within one distance to agreement (Wendling et al., Med. Phys. 34, 1647,
/// 2007, require ten).
const STEPS: i32 = 10;
/// Number of halvings of the step around the best place.
const HALVINGS: usize = 3;

/// Criterion for the agreement of two doses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Criterion {
    /// Dose difference, as a share: 0.03.
    pub dose_share: f64,
    /// Reference of the share, in Gy, for all places; `None` for the dose at each place (local).
    pub of_gy: Option<f64>,
    /// Distance to agreement, in m.
    pub distance_m: f64,
}

/// Share of the places that agree, and gamma of all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Places that were compared.
    pub compared: usize,
    /// Places with gamma of at most 1.
    pub passed: usize,
    /// Mean gamma; values of [`HIGHEST`] and more count as that.
    pub mean: f64,
    /// Largest gamma; [`HIGHEST`] for larger ones.
    pub highest: f64,
}

impl Agreement {
    /// Summarises gammas; `None` without any.
    pub fn of(gammas: &[f64]) -> Option<Self> {
        let compared = gammas.len();
        (compared > 0).then(|| Self {
            compared,
            passed: gammas.iter().filter(|g| **g <= 1.0).count(),
            mean: gammas.iter().sum::<f64>() / compared as f64,
            highest: gammas.iter().copied().fold(0.0, f64::max),
        })
    }
}

impl Criterion {
    /// Returns gamma at some places with their dose (Gy) against another dose, `None` outside of
    /// it.
    ///
    /// Shells around the place are searched from the inside. A shell whose distance alone exceeds
    /// the best gamma ends the search.
    pub fn gammas(
        &self,
        places: &[([f64; 3], f64)],
        other_gy: &(dyn Fn([f64; 3]) -> Option<f64> + Sync),
    ) -> Vec<Option<f64>> {
        let offsets = self.offsets();
        let gamma = |(place_m, dose_gy): &([f64; 3], f64)| {
            other_gy(*place_m)?;
            let allowed_gy = self.dose_share * self.of_gy.unwrap_or(*dose_gy);
            let square_at = |offset: [f64; 3], distance_square: f64| {
                let gy = other_gy([0, 1, 2].map(|a| place_m[a] + offset[a]))?;
                let off = (gy - dose_gy) / allowed_gy.max(f64::MIN_POSITIVE);
                Some(distance_square + off * off)
            };
            let (mut least, mut best) = (HIGHEST * HIGHEST, None);
            for (offset, distance_square) in &offsets {
                if *distance_square >= least {
                    break;
                }
                if let Some(square) = square_at(*offset, *distance_square).filter(|s| *s < least) {
                    (least, best) = (square, Some(*offset));
                }
            }
            // Steep doses fall between two steps: refine by half of a step, a quarter and so on
            // around the best.
            let mut step_m = self.distance_m / f64::from(STEPS);
            for _ in 0..HALVINGS {
                step_m /= 2.0;
                let Some(middle) = best else { break };
                for n in 0..27 {
                    let offset = [n % 3, n / 3 % 3, n / 9].map(|i| f64::from(i - 1) * step_m);
                    let offset: [f64; 3] = [0, 1, 2].map(|a| middle[a] + offset[a]);
                    let distance_square = offset.iter().map(|o| (o / self.distance_m).powi(2)).sum();
                    if let Some(square) = square_at(offset, distance_square).filter(|s| *s < least) {
                        (least, best) = (square, Some(offset));
                    }
                }
            }
            Some(least.sqrt())
        };
        places.par_iter().map(gamma).collect()
    }

    /// Returns steps in space (m), nearest first, with the square of their length in distances to
    /// agreement.
    fn offsets(&self) -> Vec<([f64; 3], f64)> {
        let reach = (HIGHEST * f64::from(STEPS)) as i32;
        let step_m = self.distance_m / f64::from(STEPS);
        let mut all = Vec::new();
        for k in -reach..=reach {
            for j in -reach..=reach {
                for i in -reach..=reach {
                    let square = f64::from(i * i + j * j + k * k) / f64::from(STEPS * STEPS);
                    if square < HIGHEST * HIGHEST {
                        all.push(([i, j, k].map(|n| f64::from(n) * step_m), square));
                    }
                }
            }
        }
        all.sort_by(|a, b| a.1.total_cmp(&b.1));
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACES: [[f64; 3]; 4] = [
        [0.0; 3],
        [0.004, 0.002, -0.003],
        [-0.001, 0.0, 0.006],
        [0.003, -0.003, 0.001],
    ];

    fn gammas(
        criterion: Criterion,
        dose: impl Fn([f64; 3]) -> f64,
        other: impl Fn([f64; 3]) -> Option<f64> + Sync,
    ) -> Vec<Option<f64>> {
        let places: Vec<([f64; 3], f64)> = PLACES.iter().map(|p| (*p, dose(*p))).collect();
        criterion.gammas(&places, &other)
    }

    const GLOBAL: Criterion = Criterion {
        dose_share: 0.03,
        of_gy: Some(100.0),
        distance_m: 3e-3,
    };

    /// Compares with a constant offset, whose gamma is the offset over the tolerance, everywhere.
    #[test]
    fn the_gamma_of_an_offset_is_its_share_of_the_tolerance() {
        for gamma in gammas(GLOBAL, |_| 80.0, |_| Some(82.4)) {
            assert!((gamma.unwrap() - 0.8).abs() < 1e-9);
        }
        let local = Criterion { of_gy: None, ..GLOBAL };
        for gamma in gammas(local, |_| 80.0, |_| Some(82.4)) {
            assert!((gamma.unwrap() - 1.0).abs() < 1e-9);
        }
        assert_eq!(gammas(GLOBAL, |_| 80.0, |_| None), [None; 4]);
    }

    /// Compares with a gradient of g per m shifted by s: gamma is g s / sqrt(allowed² + (g d)²),
    /// the distance of a point from a line.
    #[test]
    fn a_shifted_gradient_gives_the_distance_from_a_line() {
        for (gradient, shift_m) in [(2000.0, 2e-3), (800.0, 4e-3), (5000.0, 1e-3)] {
            let field = move |p: [f64; 3]| 60.0 + gradient * p[0];
            let expected = gradient * shift_m / 3.0_f64.hypot(gradient * GLOBAL.distance_m);
            for gamma in gammas(GLOBAL, field, |p| Some(field([p[0] - shift_m, p[1], p[2]]))) {
                let gamma = gamma.unwrap();
                assert!((gamma - expected).abs() < 0.01, "{gradient}: {gamma} {expected}");
            }
        }
    }

    /// Compares with every place of a finer lattice, without an early end.
    #[test]
    fn the_search_that_ends_early_finds_what_all_steps_find() {
        const SIDE: i32 = 81;
        let field = |p: [f64; 3]| 100.0 / (1.0 + 2e4 * ((p[0] - 0.005).powi(2) + p[1].powi(2) + p[2].powi(2)));
        let other = |p: [f64; 3]| (p[2] < 0.009).then(|| 1.02 * field([p[0] + 0.001, p[1] - 0.0015, p[2]]));
        let found = gammas(GLOBAL, field, other);
        for (place, found) in PLACES.iter().zip(found) {
            let mut least = HIGHEST;
            for n in 0..SIDE.pow(3) {
                let offset = [n % SIDE, n / SIDE % SIDE, n / SIDE / SIDE].map(|i| f64::from(i - SIDE / 2) * 0.15e-3);
                if let Some(gy) = other([0, 1, 2].map(|a| place[a] + offset[a])) {
                    let distance = offset.iter().map(|o| o * o).sum::<f64>().sqrt() / 3e-3;
                    least = least.min(distance.hypot((gy - field(*place)) / 3.0));
                }
            }
            // The search ends between the places of this lattice, at an eighth of its own step.
            assert!(
                (least - 0.02..least + 0.01).contains(&found.unwrap()),
                "{found:?} {least}"
            );
        }
    }
}
