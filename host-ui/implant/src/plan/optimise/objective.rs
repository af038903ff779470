//! What a search makes small: how far the dose at the sample points is beyond the limits, and a little for what is nice to have.
//!
//! Each limit of a histogram is a limit of a share: D10 at most 150 % means that at most a tenth gets more than 150 %. Shares
//! are counted with soft edges, so that a seed that moves by a place is felt.

use super::samples::{LANES, Samples};

/// Half of the soft edge of a share, as a share of the prescription.
const EDGE: f32 = 0.05;
/// Cost of a share beyond its limit, beside 1 for a share of cold target within it.
const BEYOND: f32 = 12.0;
/// Cost of what is within its limit: less of it is still better.
const WITHIN_HOT: f32 = 0.4;
const WITHIN_SPARED: f32 = 0.05;
/// How cold the cold part is, and how hot the hot part of the urethra.
const DEPTH: f32 = 2.0;
const NEEDLE: f32 = 5e-4;
const SEED: f32 = 2e-4;

/// Limits as the search sees them: shares, and doses as shares of the prescription.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// What the target should get: the prescription and a reserve for seeds that miss their places.
    pub level: f32,
    /// At most so much of the target gets less than that.
    pub cold: f32,
    /// At most 90 % of the target gets more than this: the upper limit of D90.
    pub most: f32,
    /// At most so much of the target gets more than 150 %.
    pub hot: f32,
    /// At most a tenth of the urethra gets more than this.
    pub urethra_tenth: f32,
    /// At most 30 % of the urethra gets more than this.
    pub urethra_third: f32,
    /// At most 2 cc of the rectum get more than this.
    pub rectum: f32,
    /// Needles at most.
    pub needles: usize,
}

/// The cost of a dose that is given for seeds of 1 U.
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
        + needles as f32 * NEEDLE
        + seeds as f32 * SEED
}

fn above(dose: f32, level: f32) -> f32 {
    ((dose - level) * (0.5 / EDGE) + 0.5).clamp(0.0, 1.0)
}

fn below(dose: f32, level: f32) -> f32 {
    1.0 - above(dose, level)
}

/// Weighted sums of several functions of the dose; their order is fixed, lane by lane.
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
