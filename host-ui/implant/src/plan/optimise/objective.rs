//! Cost of a plan: the excess of the dose at the sample points over the limits, and small terms for
//! preferences.
//!
//! Each limit of a histogram is a limit of a share: D10 at most 150 % means that at most a tenth
//! gets more than 150 %. Shares are counted with soft edges, so that the cost responds to a seed
//! that moves by one place.

use super::samples::{LANES, Samples};

/// Half width of the soft edge of a share, as a share of the prescription.
const EDGE: f32 = 0.05;
/// Cost of a share beyond its limit, relative to a share of cold target within it.
const BEYOND: f32 = 12.0;
/// Cost of values within their limits: less is still better.
const WITHIN_HOT: f32 = 0.4;
const WITHIN_SPARED: f32 = 0.05;
/// Cost of the share of the target that is expected to be cold with misplaced seeds.
const EXPECTED: f32 = 2.0;
/// End of the smooth step that replaces the normal distribution, in standard deviations.
const STEP_ENDS: f32 = 2.2;
/// Weights of the depth of the cold part, and of the excess in the hot part of the urethra.
const DEPTH: f32 = 2.0;
const SEED: f32 = 2e-4;

/// Limits in the search: shares, and doses as shares of the prescription.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Dose for the target: the prescription and a reserve for misplaced seeds.
    pub level: f32,
    /// Largest share of the target with less than that.
    pub cold: f32,
    /// Upper limit of D90: at most 90 % of the target gets more than this.
    pub most: f32,
    /// Largest share of the target with more than 150 %.
    pub hot: f32,
    /// Upper limit of D10 of the urethra.
    pub urethra_tenth: f32,
    /// Upper limit of D30 of the urethra.
    pub urethra_third: f32,
    /// Upper limit of D2cc of the rectum.
    pub rectum: f32,
    /// Expected coverage with misplaced seeds; `None` if nothing is required.
    pub expected: Option<Expected>,
    /// Largest number of needles.
    pub needles: usize,
    /// Cost of a needle.
    pub of_needle: f32,
}

/// Dose that must be kept with misplaced seeds.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// A dose, as a share of the prescription.
    pub kept: f32,
    /// Largest expected share of the target with less.
    pub cold: f32,
}

/// Returns the cost of a dose that is given for seeds of 1 U.
pub fn cost(
    samples: &Samples,
    of_one_u: &[f32],
    strength_u: f32,
    limits: &Limits,
    needles: usize,
    seeds: usize,
) -> f32 {
    let group = |range: &std::ops::Range<usize>| (&of_one_u[range.clone()], &samples.weights[range.clone()]);
    let (dose, weights) = group(&samples.target);
    let [cold, depth, most, hot] = sums(dose, weights, |d| {
        let d = d * strength_u;
        let missing = (limits.level - d).max(0.0);
        [
            below(d, limits.level),
            missing * missing,
            above(d, limits.most),
            above(d, 1.5),
        ]
    });
    let (dose, weights) = group(&samples.urethra);
    let [tenth, third, over] = sums(dose, weights, |d| {
        let d = d * strength_u;
        let excess = (d - limits.urethra_third).max(0.0);
        [
            above(d, limits.urethra_tenth),
            above(d, limits.urethra_third),
            excess.min(2.0),
        ]
    });
    let (dose, weights) = group(&samples.rectum);
    let [rectum] = sums(dose, weights, |d| [above(d * strength_u, limits.rectum)]);
    let beyond = |share: f32, limit: f32| (share - limit).max(0.0) * BEYOND;
    let expected = limits.expected.map_or(0.0, |asked| {
        let cold = expected_cold(samples, of_one_u, strength_u, asked.kept);
        beyond(cold, asked.cold) + cold * EXPECTED
    });
    beyond(cold, limits.cold)
        + cold
        + depth * DEPTH
        + beyond(most, 0.9)
        + beyond(hot, limits.hot)
        + hot * WITHIN_HOT
        + beyond(tenth, 0.1)
        + beyond(third, 0.3)
        + (tenth + third + over) * WITHIN_SPARED
        + beyond(rectum, 1.0) / 4.0
        + rectum * WITHIN_SPARED
        + expected
        + needles as f32 * limits.of_needle
        + seeds as f32 * SEED
}

/// Returns the share of the target with less than `kept` over the errors of the seeds.
fn expected_cold(samples: &Samples, of_one_u: &[f32], strength_u: f32, kept: f32) -> f32 {
    let means = &of_one_u[samples.mean.clone()];
    let variances = &of_one_u[samples.variance.clone()];
    let weights = &samples.weights[samples.mean.clone()];
    let mut lanes = [0.0_f32; LANES];
    let chunks = means.chunks_exact(LANES).zip(variances.chunks_exact(LANES));
    for ((mean, variance), weights) in chunks.zip(weights.chunks_exact(LANES)) {
        for lane in 0..LANES {
            // Rounding may leave a slightly negative number.
            let deviation = variance[lane].max(1e-8).sqrt() * strength_u;
            lanes[lane] += probability((kept - mean[lane] * strength_u) / deviation) * weights[lane];
        }
    }
    lanes.iter().sum()
}

/// Approximates the normal distribution up to a number of standard deviations.
fn probability(deviations: f32) -> f32 {
    let t = (deviations * (0.5 / STEP_ENDS) + 0.5).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn above(dose: f32, level: f32) -> f32 {
    ((dose - level) * (0.5 / EDGE) + 0.5).clamp(0.0, 1.0)
}

fn below(dose: f32, level: f32) -> f32 {
    1.0 - above(dose, level)
}

/// Returns weighted sums of several functions of the dose; their order is fixed, lane by lane.
fn sums<const N: usize>(dose: &[f32], weights: &[f32], of: impl Fn(f32) -> [f32; N]) -> [f32; N] {
    let mut lanes = [[0.0_f32; LANES]; N];
    for (dose, weights) in dose.chunks_exact(LANES).zip(weights.chunks_exact(LANES)) {
        for lane in 0..LANES {
            let values = of(dose[lane]);
            for n in 0..N {
                lanes[n][lane] += values[n] * weights[lane];
            }
        }
    }
    lanes.map(|of_lane| of_lane.iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smooth_step_is_near_the_normal_distribution() {
        // Abramowitz and Stegun, table 26.1.
        for (deviations, expected) in [
            (0.0, 0.5),
            (0.5, 0.69146),
            (1.0, 0.84134),
            (1.5, 0.93319),
            (2.0, 0.97725),
        ] {
            assert!(
                (probability(deviations) - expected).abs() < 0.03,
                "{deviations}: {}",
                probability(deviations)
            );
            assert!((probability(-deviations) - 1.0 + expected).abs() < 0.025);
        }
        assert_eq!((probability(-9.0), probability(9.0)), (0.0, 1.0));
    }

    #[test]
    fn sums_are_weighted_means_and_edges_are_soft_about_their_level() {
        let dose: Vec<f32> = (0..16).map(|i| 0.9 + 0.0125 * i as f32).collect();
        let weights = [1.0 / 16.0; 16];
        let [mean, cold] = sums(&dose, &weights, |d| [d, below(d, 1.0)]);
        assert!((mean - 0.99375).abs() < 1e-5, "{mean}");
        assert!((cold - 0.5).abs() < 0.04, "{cold}");
        let values = [(1.0 + EDGE, 1.0), (1.0 - EDGE, 0.0), (1.0, 0.5)];
        assert!(
            values
                .iter()
                .all(|(dose, share)| (above(*dose, 1.0) - share).abs() < 1e-5)
        );
    }
}
