//! Confidence bound of a count of missed deadlines, which needs no model of the times, after Clopper and Pearson
//! (1934).

use serde::{Deserialize, Serialize};

/// Confidence of every bound.
const CONFIDENCE: f64 = 0.95;

/// Bound from a count of misses in `of` grid points, if misses are independent.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MissBound {
    pub misses: u64,
    /// Grid points, served or missed.
    pub of: u64,
    pub confidence: f64,
    /// Upper bound of the probability of a miss, at this confidence.
    pub at_most: Option<f64>,
    /// The same as misses per hour.
    pub at_most_per_hour: Option<f64>,
}

/// Returns the bound of `misses` in `of` grid points, `rate_hz` of them a second.
pub fn of_misses(misses: u64, of: u64, rate_hz: f64) -> MissBound {
    let at_most = (of > 0).then(|| upper(misses.min(of), of, CONFIDENCE));
    MissBound {
        misses,
        of,
        confidence: CONFIDENCE,
        at_most,
        at_most_per_hour: at_most.map(|p| p * rate_hz * 3600.0),
    }
}

/// Returns the one-sided upper bound of Clopper and Pearson for `k` in `n`.
fn upper(k: u64, n: u64, confidence: f64) -> f64 {
    if k >= n {
        return 1.0;
    }
    if k == 0 {
        return -((1.0 - confidence).ln() / n as f64).exp_m1();
    }
    let (a, b) = (k as f64 + 1.0, (n - k) as f64);
    let (mut low, mut high) = (0.0, 1.0);
    // Relative precision, since the probabilities are small.
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if incomplete_beta(a, b, middle) < confidence {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Returns the regularised incomplete beta function, by the continued fraction of Lentz.
fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return if x <= 0.0 { 0.0 } else { 1.0 };
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (-x).ln_1p()).exp();
    if x < (a + 1.0) / (a + b + 2.0) {
        front * fraction(a, b, x) / a
    } else {
        1.0 - front * fraction(b, a, 1.0 - x) / b
    }
}

fn fraction(a: f64, b: f64, x: f64) -> f64 {
    let kept = |v: f64| if v.abs() < 1e-300 { 1e-300 } else { v };
    let (mut c, mut d) = (1.0, 1.0 / kept(1.0 - (a + b) * x / (a + 1.0)));
    let mut h = d;
    // It takes about the square root of the larger argument: a night at 10 kHz has 3e8 ticks.
    for m in 1..200_000 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut change = 1.0;
        for term in [even, odd] {
            d = 1.0 / kept(1.0 + term * d);
            c = kept(1.0 + term / c);
            change = c * d;
            h *= change;
        }
        if (change - 1.0_f64).abs() < 1e-15 {
            break;
        }
    }
    h
}

/// Computes Stirling's series, after a shift to where it is exact in double precision.
fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 15.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let r = 1.0 / (x * x);
    let series = (1.0 / 12.0 - r * (1.0 / 360.0 - r * (1.0 / 1260.0 - r / 1680.0))) / x;
    shift + (x - 0.5) * x.ln() - x + 0.5 * (2.0 * std::f64::consts::PI).ln() + series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_the_exact_ones() {
        // Oracle: the binomial sum itself. At the bound, k or fewer in n has a probability of 5 %.
        for (k, n) in [(0_u64, 30_u64), (1, 30), (3, 100), (7, 1_000), (20, 60_000)] {
            let p = upper(k, n, 0.95);
            let (mut term, mut sum) = ((n as f64 * (-p).ln_1p()).exp(), 0.0);
            for i in 0..=k {
                sum += term;
                term *= (n - i) as f64 / (i + 1) as f64 * p / (1.0 - p);
            }
            assert!((sum - 0.05).abs() < 1e-8, "{k} in {n}: {p}, sum {sum}");
        }
        // Two-sided 95 % of 1 in 10 ends at 0.4450 (the usual tables).
        assert!((upper(1, 10, 0.975) - 0.4450).abs() < 5e-5);
    }

    #[test]
    fn no_miss_is_bounded_by_three_in_n() {
        let b = of_misses(0, 60_000, 1_000.0);
        let (exact, three) = (b.at_most.expect("n > 0"), 3.0 / b.of as f64);
        assert!(exact < three && exact > 0.998 * three, "{exact} {three}");
        assert!(b.at_most_per_hour.is_some_and(|h| (h - exact * 3.6e6).abs() < 1e-9));
        assert!(of_misses(0, 0, 1_000.0).at_most.is_none());
    }
}
