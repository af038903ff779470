//! Summarises a histogram in a few numbers, without percentiles that the run was too short for.

use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};

/// The percentiles of every report.
pub const QUANTILES: [(&str, f64); 5] = [
    ("p50", 0.5),
    ("p90", 0.9),
    ("p99", 0.99),
    ("p99.9", 0.999),
    ("p99.99", 0.9999),
];
/// Samples that must lie beyond a percentile before it is reported.
const BEYOND: f64 = 10.0;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantile {
    pub name: String,
    pub us: Option<f64>,
    /// 95 % interval, from how far the parts of the run differ; valid for samples that depend on each other over less
    /// than a part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval_us: Option<[f64; 2]>,
    /// Length of run needed for a missing value.
    pub needs_s: Option<f64>,
}

/// One measured time, microseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    pub name: String,
    pub count: u64,
    pub min_us: Option<f64>,
    pub mean_us: Option<f64>,
    pub quantiles: Vec<Quantile>,
    pub max_us: Option<f64>,
}

impl Summary {
    pub fn quantile(&self, name: &str) -> Option<&Quantile> {
        self.quantiles.iter().find(|q| q.name == name)
    }
}

/// Samples that a percentile needs.
pub fn needed(quantile: f64) -> u64 {
    (BEYOND / (1.0 - quantile) - 1e-6).ceil() as u64
}

/// Returns a quantile in microseconds, when enough samples lie beyond it.
pub fn quantile_us(histogram: &Histogram<u64>, quantile: f64) -> Option<f64> {
    (histogram.len() >= needed(quantile)).then(|| histogram.value_at_quantile(quantile) as f64 / 1e3)
}

/// Parts that an interval needs.
const FEWEST_PARTS: usize = 4;

/// Returns the 95 % interval of a percentile by batch means, widened to the bins in which its ends lie; `None` if the
/// parts are too few, or too little lies beyond its upper end.
///
/// The share of samples beyond the percentile differs from part to part. Its variance over the whole run, with samples
/// that depend on each other within a part, is that of the mean of the parts (Schmeiser 1982). The interval of the share
/// is Student's, mapped back through the distribution (Woodruff 1952). On the logit scale its upper end was missed eight
/// times as often as its lower one, with some ten independent samples beyond it.
pub fn interval_us(whole: &Histogram<u64>, parts: &[Histogram<u64>], quantile: f64) -> Option<[f64; 2]> {
    let at_ns = whole.value_at_quantile(quantile);
    let counts = |h: &Histogram<u64>| (h.len() as f64, (h.len() - h.count_between(0, at_ns)) as f64);
    let (n, beyond) = counts(whole);
    let used: Vec<(f64, f64)> = parts.iter().map(counts).filter(|(n, _)| *n > 0.0).collect();
    if used.len() < FEWEST_PARTS {
        return None;
    }
    let k = used.len() as f64;
    let squares: f64 = used.iter().map(|(of, over)| (over - beyond / n * of).powi(2)).sum();
    let deviation = (k / (k - 1.0) * squares).sqrt() / n;
    let half = student_975(k - 1.0) * deviation;
    let [low, high] = [quantile - half, quantile + half];
    // Beyond the upper end there must be a sample: the largest one is no bound.
    ((1.0 - high) * n >= 1.0).then(|| {
        let from_ns = whole.lowest_equivalent(whole.value_at_quantile(low.max(0.0)));
        let to_ns = whole.highest_equivalent(whole.value_at_quantile(high));
        [from_ns, to_ns].map(|ns| ns as f64 / 1e3)
    })
}

/// Returns the 97.5 % point of Student's distribution, by the expansion of Cornish and Fisher; within 0.005 from three
/// degrees of freedom on.
fn student_975(freedom: f64) -> f64 {
    let z: f64 = 1.959_964;
    let power = |n| z.powi(n);
    z + (power(3) + z) / (4.0 * freedom)
        + (5.0 * power(5) + 16.0 * power(3) + 3.0 * z) / (96.0 * freedom.powi(2))
        + (3.0 * power(7) + 19.0 * power(5) + 17.0 * power(3) - 15.0 * z) / (384.0 * freedom.powi(3))
}

/// Summarises a histogram of `rate_hz` samples a second; `parts` are those of equal parts of the run.
pub fn summary(name: &str, whole: &Histogram<u64>, parts: &[Histogram<u64>], rate_hz: f64) -> Summary {
    let some = !whole.is_empty();
    Summary {
        name: name.to_owned(),
        count: whole.len(),
        min_us: some.then(|| whole.min() as f64 / 1e3),
        mean_us: some.then(|| whole.mean() / 1e3),
        quantiles: QUANTILES
            .map(|(name, q)| {
                let us = quantile_us(whole, q);
                Quantile {
                    name: name.to_owned(),
                    us,
                    interval_us: us.and_then(|_| interval_us(whole, parts, q)),
                    needs_s: us.is_none().then(|| needed(q) as f64 / rate_hz),
                }
            })
            .to_vec(),
        max_us: some.then(|| whole.max() as f64 / 1e3),
    }
}

#[cfg(test)]
mod tests;
