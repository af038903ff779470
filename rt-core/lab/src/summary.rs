//! A histogram in a few numbers; a percentile that the run was too short for has none.

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
    /// When there is no value: how long the run must be.
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

/// In microseconds, when enough samples lie beyond it.
pub fn quantile_us(histogram: &Histogram<u64>, quantile: f64) -> Option<f64> {
    (histogram.len() >= needed(quantile)).then(|| histogram.value_at_quantile(quantile) as f64 / 1e3)
}

/// `rate_hz`: how many samples a second bring.
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
                Quantile { name, us, needs_s }
            })
            .to_vec(),
        max_us: some.then(|| histogram.max() as f64 / 1e3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collect::histogram;

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
    fn nothing_measured_has_no_numbers() {
        let s = summary("x", &histogram(), 200.0);
        assert!(s.min_us.is_none() && s.max_us.is_none());
        assert_eq!(s.quantile("p50").and_then(|q| q.needs_s), Some(0.1));
    }
}
