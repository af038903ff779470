//! Confidence bound of a count of missed deadlines, which needs no model of the times, after Clopper and Pearson
//! (1934).

use serde::Serialize;

/// Confidence of every bound.
const CONFIDENCE: f64 = 0.95;

/// Bound from a count of misses in `of` grid points, if misses are independent.
#[derive(Clone, Debug, Serialize)]
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

/// Ranks, counted from 1, between whose order statistics the quantile `q` of `n` independent samples lies with 95 %
/// confidence, for any distribution; `None` if there are too few samples.
///
/// The number of samples at or below the quantile is binomial (n, q); each end leaves 2.5 % (David and Nagaraja, Order
/// Statistics, section 7.1).
pub fn ranks_of_quantile(q: f64, n: u64) -> Option<(u64, u64)> {
    if n == 0 {
        return None;
    }
    let out = (1.0 - CONFIDENCE) / 2.0;
    // The largest r with P(count < r) <= 2.5 %, and the smallest s with P(count < s) >= 97.5 %.
    let first_above = |p: f64| {
        let (mean, sd) = (q * n as f64, (q * (1.0 - q) * n as f64).sqrt());
        // Eight deviations: the probability farther out is below 1e-10.
        let (mut low, mut high) = (
            (mean - 8.0 * sd - 8.0).max(0.0) as u64,
            ((mean + 8.0 * sd + 8.0) as u64).min(n),
        );
        while low < high {
            let middle = low + (high - low) / 2;
            if binomial_cdf(middle, n, q) < p {
                low = middle + 1
            } else {
                high = middle
            }
        }
        low
    };
    let (below, above) = (first_above(out), first_above(1.0 - out) + 1);
    // `below` is the first count whose probability passes 2.5 %: all smaller ones together stay under it.
    (below >= 1 && above <= n).then_some((below, above))
}

/// Returns the probability of at most `k` successes in `n` trials of probability `p`.
pub fn binomial_cdf(k: u64, n: u64, p: f64) -> f64 {
    if k >= n {
        return 1.0;
    }
    incomplete_beta((n - k) as f64, k as f64 + 1.0, 1.0 - p)
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
    fn ranks_of_a_quantile_leave_at_most_the_error_on_each_side() {
        // Oracle: the binomial sum itself, and that one rank closer would leave more than 2.5 %.
        for (q, n) in [(0.5, 20_u64), (0.9, 100), (0.99, 1_000), (0.999, 12_345)] {
            let (r, s) = ranks_of_quantile(q, n).expect("enough samples");
            let (mut sum, mut below) = (0.0, Vec::new());
            let ln_choose =
                |k: u64| ln_gamma(n as f64 + 1.0) - ln_gamma(k as f64 + 1.0) - ln_gamma((n - k) as f64 + 1.0);
            for k in 0..=n {
                below.push(sum);
                sum += (ln_choose(k) + k as f64 * q.ln() + (n - k) as f64 * (-q).ln_1p()).exp();
            }
            let below = |rank: u64| below[rank as usize];
            assert!(below(r) <= 0.025 && below(r + 1) > 0.025, "{q} of {n}: rank {r}");
            assert!(below(s) >= 0.975 && below(s - 1) < 0.975, "{q} of {n}: rank {s}");
        }
        // The median of 20: ranks 6 and 15 (the usual tables).
        assert_eq!(ranks_of_quantile(0.5, 20), Some((6, 15)));
        assert_eq!(ranks_of_quantile(0.5, 5), None);
        assert_eq!(ranks_of_quantile(0.5, 0), None);
        // A night: the normal distribution is an oracle to within a few ranks.
        let (r, s) = ranks_of_quantile(0.99, 300_000_000).expect("enough samples");
        let half = 1.959_964 * (0.99_f64 * 0.01 * 3e8).sqrt();
        assert!(
            (r as f64 - (2.97e8 - half)).abs() < 5.0 && (s as f64 - (2.97e8 + half)).abs() < 5.0,
            "{r} {s}"
        );
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
