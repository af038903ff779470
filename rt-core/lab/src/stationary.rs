//! Tests whether a run was stationary: Kolmogorov-Smirnov tests on wake-ups that were thinned until independent.

use crate::sample::PARTS;
use serde::{Deserialize, Serialize};

/// Probability below which a test rejects.
pub const LEVEL: f64 = 0.01;
/// Values that the tests need after thinning.
const FEWEST: usize = 400;
/// Lags at which neighbours are compared.
const LAGS: usize = 5;
/// Two-sided 1 % of the normal distribution.
const NORMAL_1_PERCENT: f64 = 2.575_8;

/// One test with its figure.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TestResult {
    pub name: String,
    /// Largest distance between two distribution functions.
    pub distance: f64,
    pub p: f64,
}

impl TestResult {
    pub fn rejects(&self) -> bool {
        self.p < LEVEL
    }

    /// Returns the result as a reason, with the limit.
    fn said(&self) -> String {
        format!(
            "{}: distance {:.3}, p {:.1e}, below {LEVEL}",
            self.name, self.distance, self.p
        )
    }
}

/// Result of the tests.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Stationarity {
    /// Ticks between the compared values.
    pub every: u64,
    pub values: usize,
    /// Values at that distance are independent.
    pub independent: bool,
    pub tests: Vec<TestResult>,
    /// Reasons why the run does not count as stationary; empty if it does.
    pub against: Vec<String>,
}

/// Examines a series in time order; `stride` is the number of ticks between values.
pub fn examine(series: &[u64], stride: u64) -> Stationarity {
    let mut step = 1;
    let mut kept: Vec<f64> = series.iter().map(|&v| v as f64).collect();
    let mut independent = kept.len() >= FEWEST && !depends(&kept);
    while !independent && kept.len() >= 2 * FEWEST {
        step *= 2;
        kept = series.iter().step_by(step).map(|&v| v as f64).collect();
        independent = !depends(&kept);
    }
    let every = stride * step as u64;
    let mut against = Vec::new();
    let mut tests = Vec::new();
    if kept.len() < FEWEST {
        against.push(format!("{} wake-ups, the tests need {FEWEST}", kept.len()));
    } else {
        tests.extend([halves(&kept), parts(&kept)]);
        against.extend(tests.iter().filter(|t| t.rejects()).map(TestResult::said));
        if !independent {
            against.push(format!("wake-ups {every} ticks apart still depend on each other"));
        }
    }
    Stationarity {
        every,
        values: kept.len(),
        independent,
        tests,
        against,
    }
}

/// True if a value and the next few are rank-correlated beyond what each part of the run has in common.
fn depends(values: &[f64]) -> bool {
    let mut ranks = ranks(values);
    for part in ranks.chunks_mut(values.len().div_ceil(PARTS)) {
        let mean = part.iter().sum::<f64>() / part.len() as f64;
        part.iter_mut().for_each(|r| *r -= mean);
    }
    let square: f64 = ranks.iter().map(|r| r * r).sum();
    if square == 0.0 {
        return true;
    }
    let n = ranks.len() as f64;
    // The mean of each part was removed, which shifts each correlation by about minus one over the length of a part.
    let bias = PARTS as f64 / n;
    (1..=LAGS).any(|lag| {
        let product: f64 = ranks.iter().zip(&ranks[lag..]).map(|(a, b)| a * b).sum();
        (product / square + bias).abs() > NORMAL_1_PERCENT / n.sqrt() * (1.0 + LAGS as f64 / 10.0)
    })
}

/// Returns the mean ranks; equal values share theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_unstable_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut from = 0;
    while from < order.len() {
        let same = order[from..]
            .iter()
            .take_while(|&&i| values[i] == values[order[from]])
            .count();
        for &i in &order[from..from + same] {
            ranks[i] = from as f64 + (same as f64 - 1.0) / 2.0;
        }
        from += same;
    }
    ranks
}

fn halves(values: &[f64]) -> TestResult {
    let (first, second) = values.split_at(values.len() / 2);
    two_samples("first half against second half", first, second)
}

/// Tests each part against the rest of the run; returns the smallest probability, times the number of parts
/// (Bonferroni).
fn parts(values: &[f64]) -> TestResult {
    let length = values.len().div_ceil(PARTS);
    let against_rest = |i: usize| {
        let (from, to) = ((i * length).min(values.len()), ((i + 1) * length).min(values.len()));
        let rest: Vec<f64> = values[..from].iter().chain(&values[to..]).copied().collect();
        two_samples("an eighth against the rest", &values[from..to], &rest)
    };
    let all = (0..PARTS).map(against_rest);
    let mut worst = all.min_by(|a, b| a.p.total_cmp(&b.p)).expect("there are parts");
    worst.p = (worst.p * PARTS as f64).min(1.0);
    worst
}

/// Makes Kolmogorov and Smirnov's test of two samples.
fn two_samples(name: &'static str, a: &[f64], b: &[f64]) -> TestResult {
    let sorted = |of: &[f64]| {
        let mut all = of.to_vec();
        all.sort_unstable_by(f64::total_cmp);
        all
    };
    let (a, b) = (sorted(a), sorted(b));
    let (n, m) = (a.len() as f64, b.len() as f64);
    let (mut i, mut j, mut distance) = (0, 0, 0.0_f64);
    while i < a.len() && j < b.len() {
        // Equal values are passed together.
        let at = a[i].min(b[j]);
        while i < a.len() && a[i] <= at {
            i += 1;
        }
        while j < b.len() && b[j] <= at {
            j += 1;
        }
        distance = distance.max((i as f64 / n - j as f64 / m).abs());
    }
    let p = if n * m == 0.0 {
        1.0
    } else {
        kolmogorov(distance, n * m / (n + m))
    };
    TestResult {
        name: name.to_owned(),
        distance,
        p,
    }
}

/// Returns the probability of at least this distance; `n` values, or n m / (n + m) of two samples (Stephens 1970).
fn kolmogorov(distance: f64, n: f64) -> f64 {
    let x = (n.sqrt() + 0.12 + 0.11 / n.sqrt()) * distance;
    if x < 0.2 {
        return 1.0;
    }
    let term = |k: i32| {
        let sign = if k % 2 == 1 { 2.0 } else { -2.0 };
        sign * (-2.0 * f64::from(k * k) * x * x).exp()
    };
    (1..=100).map(term).sum::<f64>().clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_random::Random;

    /// Draws exponential wake-ups of mean 100 us; those of the second half are `factor` times as long.
    fn run(seed: u64, factor: f64) -> Vec<u64> {
        let mut random = Random(seed);
        let n = 4_096;
        let draw = |i: usize| {
            let mean = if i < n / 2 { 1e5 } else { factor * 1e5 };
            (-(1.0 - random.unit()).ln() * mean) as u64
        };
        (0..n).map(draw).collect()
    }

    fn refused(factor: f64) -> usize {
        (0..100)
            .filter(|&seed| !examine(&run(1_000 + seed, factor), 1).against.is_empty())
            .count()
    }

    #[test]
    fn kolmogorov_has_the_values_of_the_tables() {
        // Asymptotic 5 %, 1 % and 0.1 % points of sqrt(n) D.
        for (x, p) in [(1.3581, 0.05), (1.6276, 0.01), (1.9495, 0.001)] {
            let n = 1e12_f64;
            assert!((kolmogorov(x / n.sqrt(), n) / p - 1.0).abs() < 2e-3, "{x}");
        }
    }

    #[test]
    fn distances_are_those_of_the_definition() {
        // Oracle: both distribution functions at every value.
        let mut random = Random(3);
        let a: Vec<f64> = (0..57).map(|_| (random.unit() * 20.0).floor()).collect();
        let b: Vec<f64> = (0..83).map(|_| (random.unit() * 25.0).floor()).collect();
        let below = |of: &[f64], v: f64| of.iter().filter(|x| **x <= v).count() as f64 / of.len() as f64;
        let brute = a
            .iter()
            .chain(&b)
            .map(|&v| (below(&a, v) - below(&b, v)).abs())
            .fold(0.0, f64::max);
        assert!((two_samples("", &a, &b).distance - brute).abs() < 1e-12);
    }

    #[test]
    fn a_run_that_stayed_the_same_is_seldom_refused() {
        let n = refused(1.0);
        // Two tests at 1 %: 2 of 100, and three deviations.
        assert!(n <= 6, "{n} of 100");
    }

    #[test]
    fn halves_of_different_scale_are_refused() {
        // The measured power: 4,096 wake-ups show a tenth more in the second half in some runs, a fifth more in nearly
        // all.
        for (factor, least) in [(1.1, 35), (1.2, 95), (1.5, 100)] {
            let n = refused(factor);
            println!("scale {factor}: {n} of 100 refused");
            assert!(n >= least, "scale {factor}: {n} of 100");
        }
    }

    #[test]
    fn dependent_wake_ups_are_thinned_and_an_unending_dependence_is_refused() {
        let mut random = Random(11);
        let mut walk = |memory: f64| -> Vec<u64> {
            let mut x = 0.0;
            let next = |_| {
                x = memory * x + random.unit() - 0.5;
                ((x + 1_000.0) * 1e6) as u64
            };
            (0..16_000).map(next).collect()
        };
        let short = examine(&walk(0.8), 4);
        // Correlation 0.8^16 is 0.03: lost in 1,000 values.
        assert!(short.independent && (32..=128).contains(&short.every), "{short:?}");
        let long = examine(&walk(0.9999), 4);
        assert!(!long.against.is_empty(), "{long:?}");
    }

    #[test]
    fn too_few_wake_ups_are_refused_with_their_number() {
        assert_eq!(examine(&[5; 100], 1).against, ["100 wake-ups, the tests need 400"]);
        // A stopped clock.
        assert!(!examine(&[5; 1_000], 1).against.is_empty());
    }
}
