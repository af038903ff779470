//! Means with intervals for enough values, and a trend for enough sessions.

/// Fewest values with an interval.
const LEAST_FOR_INTERVAL: usize = 3;
/// Fewest sessions with a trend.
const LEAST_FOR_TREND: usize = 5;

/// Mean of some values, with its 95 % interval (Student's t) from three values on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Number of values.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// Range that contains the mean of many more with a probability of 95 %, if they are normal and
    /// independent.
    pub interval: Option<[f64; 2]>,
}

impl Summary {
    /// Summarises values; `None` without any.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len();
        if count == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / count as f64;
        let interval = (count >= LEAST_FOR_INTERVAL).then(|| {
            let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
            let error = (squares / (count - 1) as f64 / count as f64).sqrt();
            let reach = t_95(count - 1) * error;
            [mean - reach, mean + reach]
        });
        Some(Self { count, mean, interval })
    }
}

/// Change from session to session, least squares, with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trend {
    /// Value of the line at the first session.
    pub first: f64,
    /// Change per session.
    pub slope: f64,
    /// Interval of the slope.
    pub interval: [f64; 2],
}

impl Trend {
    /// Fits values of successive sessions; `None` for fewer than five, and if the interval contains
    /// zero.
    pub fn of(values: &[f64]) -> Option<Self> {
        let n = values.len();
        if n < LEAST_FOR_TREND {
            return None;
        }
        let (middle, mean) = ((n - 1) as f64 / 2.0, values.iter().sum::<f64>() / n as f64);
        let of_x = |i: usize| i as f64 - middle;
        let across: f64 = (0..n).map(|i| of_x(i).powi(2)).sum();
        let slope = values
            .iter()
            .enumerate()
            .map(|(i, v)| of_x(i) * (v - mean))
            .sum::<f64>()
            / across;
        let left: f64 = values
            .iter()
            .enumerate()
            .map(|(i, v)| (v - mean - slope * of_x(i)).powi(2))
            .sum();
        let reach = t_95(n - 2) * (left / (n - 2) as f64 / across).sqrt();
        let interval = [slope - reach, slope + reach];
        let is_change = interval[0] > 0.0 || interval[1] < 0.0;
        is_change.then_some(Self {
            first: mean - slope * middle,
            slope,
            interval,
        })
    }
}

/// Returns the two-sided 95 % quantile of Student's t: exact to the third decimal up to 10, then an
/// equally accurate series.
fn t_95(freedom: usize) -> f64 {
    const TABLE: [f64; 10] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228];
    match TABLE.get(freedom.saturating_sub(1)) {
        Some(t) => *t,
        None => {
            // Cornish-Fisher (Abramowitz and Stegun 26.7.5).
            let (z, n) = (1.959_964_f64, freedom as f64);
            let first = (z.powi(3) + z) / 4.0;
            let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
            let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
            z + first / n + second / n.powi(2) + third / n.powi(3)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_printed_tables() {
        for (freedom, t) in [
            (1, 12.706),
            (10, 2.228),
            (11, 2.201),
            (20, 2.086),
            (30, 2.042),
            (120, 1.980),
        ] {
            assert!((t_95(freedom) - t).abs() < 1e-3, "{freedom}: {}", t_95(freedom));
        }
    }

    #[test]
    fn a_mean_has_an_interval_from_three_values_on() {
        assert_eq!(Summary::of(&[]), None);
        assert_eq!(
            Summary::of(&[1.0, 3.0]).map(|s| (s.mean, s.interval)),
            Some((2.0, None))
        );
        // Standard deviation 1, standard error 1 / sqrt(3), t 4.303.
        let [low, high] = Summary::of(&[1.0, 2.0, 3.0]).and_then(|s| s.interval).expect("three");
        assert!((low - (2.0 - 2.4843)).abs() < 1e-3 && (high - (2.0 + 2.4843)).abs() < 1e-3);
    }

    #[test]
    fn a_trend_is_shown_only_if_significant() {
        assert_eq!(Trend::of(&[5.0, 4.0, 3.0, 2.0]), None, "too few");
        assert_eq!(Trend::of(&[3.0, 2.0, 3.1, 1.9, 3.0, 2.2]), None, "noise");
        let falls = Trend::of(&[5.0, 4.1, 3.0, 1.9, 1.0]).expect("falls");
        assert!(
            (falls.slope + 1.02).abs() < 1e-12 && (falls.first - 5.04).abs() < 1e-12,
            "{falls:?}"
        );
        // By hand: residuals -0.04, 0.08, 0, -0.08, 0.04: 0.016 / 3 / 10, t 3.182.
        assert!((falls.interval[1] - falls.slope - 3.182 * (0.016_f64 / 30.0).sqrt()).abs() < 1e-9);
    }
}
