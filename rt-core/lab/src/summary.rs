//! Summarises a histogram in a few numbers, without percentiles that the run was too short for.

use crate::bound::ranks_of_quantile;
use hdrhistogram::Histogram;
use serde::Serialize;

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

#[derive(Clone, Debug, Serialize)]
pub struct Quantile {
    pub name: &'static str,
    pub us: Option<f64>,
    /// 95 % interval, from the order statistics of the samples; valid for any distribution of independent samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval_us: Option<[f64; 2]>,
    /// Length of run needed for a missing value.
    pub needs_s: Option<f64>,
}

/// One measured time, microseconds.
#[derive(Clone, Debug, Serialize)]
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

/// Returns the 95 % interval of a percentile, widened to the bins in which its ends lie.
pub fn interval_us(histogram: &Histogram<u64>, quantile: f64) -> Option<[f64; 2]> {
    let (low, high) = ranks_of_quantile(quantile, histogram.len())?;
    let (mut below, mut from_ns) = (0, None);
    for bin in histogram.iter_recorded() {
        below += bin.count_at_value();
        if below >= low && from_ns.is_none() {
            from_ns = Some(histogram.lowest_equivalent(bin.value_iterated_to()));
        }
        if below >= high {
            let to_ns = histogram.highest_equivalent(bin.value_iterated_to());
            return from_ns.map(|from_ns| [from_ns, to_ns].map(|ns| ns as f64 / 1e3));
        }
    }
    None
}

/// Summarises a histogram of `rate_hz` samples a second.
pub fn summary(name: &str, histogram: &Histogram<u64>, rate_hz: f64) -> Summary {
    let some = !histogram.is_empty();
    Summary {
        name: name.to_owned(),
        count: histogram.len(),
        min_us: some.then(|| histogram.min() as f64 / 1e3),
        mean_us: some.then(|| histogram.mean() / 1e3),
        quantiles: QUANTILES
            .map(|(name, q)| {
                let us = quantile_us(histogram, q);
                let needs_s = us.is_none().then(|| needed(q) as f64 / rate_hz);
                let interval_us = us.and_then(|_| interval_us(histogram, q));
                Quantile {
                    name,
                    us,
                    interval_us,
                    needs_s,
                }
            })
            .to_vec(),
        max_us: some.then(|| histogram.max() as f64 / 1e3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::histogram;

    #[test]
    fn percentiles_agree_with_a_sorted_list_and_need_ten_samples_beyond() {
        let mut h = histogram();
        let mut all = Vec::new();
        for i in 0..10_000_u64 {
            let ns = 1_000 + i * i * 7919 % 100_003;
            h.record(ns).expect("in range");
            all.push(ns);
        }
        all.sort_unstable();
        let s = summary("x", &h, 1_000.0);
        for (name, q) in [("p50", 0.5), ("p90", 0.9), ("p99", 0.99), ("p99.9", 0.999)] {
            let exact_us = all[(q * 10_000.0) as usize - 1] as f64 / 1e3;
            let us = s.quantile(name).and_then(|q| q.us).expect("enough samples");
            assert!((us / exact_us - 1.0).abs() < 2e-3, "{name}: {us} against {exact_us}");
        }
        let last = s.quantile("p99.99").expect("in the list");
        assert_eq!((last.us, last.needs_s), (None, Some(100.0)));
        assert_eq!(s.count, 10_000);
    }

    #[test]
    fn interval_holds_the_percentile_in_95_of_100_runs() {
        // Claim: over 400 seeded runs with a known p90 and p99, the intervals contain them as often as the binomial
        // allows, at least 95 % minus three deviations. Bins widen the intervals slightly, so the only upper bound is
        // 400.
        for (name, q) in [("p90", 0.9), ("p99", 0.99)] {
            let mut held = 0;
            for seed in 0..400_u64 {
                let mut random = stylet_random::Random(seed);
                let mut h = histogram();
                for _ in 0..2_000 {
                    // Exponential of mean 100 us.
                    h.saturating_record((-(1.0 - random.unit()).ln() * 1e5) as u64);
                }
                let s = summary("x", &h, 1_000.0);
                let [low, high] = s.quantile(name).and_then(|q| q.interval_us).expect("enough samples");
                let true_us = -(1.0_f64 - q).ln() * 100.0;
                held += u32::from(low <= true_us && true_us <= high);
            }
            assert!((367..=398).contains(&held), "{name}: {held} of 400");
        }
    }

    #[test]
    fn interval_ends_at_the_samples_of_its_ranks() {
        let mut h = histogram();
        for us in 1..=1_000_u64 {
            h.record(us * 1_000).expect("in range");
        }
        let (low, high) = ranks_of_quantile(0.5, 1_000).expect("enough samples");
        let [from, to] = interval_us(&h, 0.5).expect("enough samples");
        assert!(
            (from - low as f64).abs() < 1.0 && (to - high as f64).abs() < 1.0,
            "{from} {to}"
        );
        assert!(interval_us(&histogram(), 0.5).is_none());
    }

    #[test]
    fn nothing_measured_has_no_numbers() {
        let s = summary("x", &histogram(), 200.0);
        assert!(s.min_us.is_none() && s.max_us.is_none());
        assert_eq!(s.quantile("p50").and_then(|q| q.needs_s), Some(0.1));
    }
}
