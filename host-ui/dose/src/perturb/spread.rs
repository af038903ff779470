//! Spread of measures over trials: mean with its interval, deviation, percentiles.

/// One measure over all trials, in its unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// Name and unit of the measure.
    pub name: String,
    /// Value of the unperturbed plan.
    pub planned: Option<f64>,
    /// Mean; `None` if the measure is defined in no trial.
    pub mean: Option<f64>,
    /// Standard deviation of a sample; `None` for fewer than two trials.
    pub deviation: Option<f64>,
    /// Ends of the 95 % interval of the mean (Student's t); `None` for fewer than two trials.
    pub interval: Option<[f64; 2]>,
    /// The 5th, 25th, 50th, 75th and 95th percentile; `None` if the measure is defined in no trial.
    pub percentiles: Option<[f64; 5]>,
    /// Trials in which the measure is defined; the figures above are from these.
    pub defined: usize,
}

/// The percentiles of a [`Spread`].
pub const PERCENTILES: [f64; 5] = [5.0, 25.0, 50.0, 75.0, 95.0];

/// Computes mean, deviation and percentiles of each measure.
pub fn spreads(planned: &[(String, Option<f64>)], trials: &[(usize, Vec<Option<f64>>)]) -> Vec<Spread> {
    planned
        .iter()
        .enumerate()
        .map(|(column, (name, value))| {
            let mut values: Vec<f64> = trials.iter().filter_map(|(_, row)| row[column]).collect();
            values.sort_by(f64::total_cmp);
            let count = values.len() as f64;
            let mean = values.iter().sum::<f64>() / count;
            let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
            let last = values.len().checked_sub(1);
            let deviation = last.filter(|&l| l > 0).map(|_| (square / (count - 1.0)).sqrt());
            let half = deviation.map(|d| t_95(values.len() - 1) * d / count.sqrt());
            Spread {
                name: name.clone(),
                planned: *value,
                mean: last.map(|_| mean),
                deviation,
                interval: half.map(|half| [mean - half, mean + half]),
                percentiles: last.map(|_| PERCENTILES.map(|p| percentile(&values, p))),
                defined: values.len(),
            }
        })
        .collect()
}

/// Interpolates between the sorted values (Hyndman and Fan's type 7), of which there is at least
/// one.
fn percentile(sorted: &[f64], percent: f64) -> f64 {
    let last = sorted.len() - 1;
    let at = percent / 100.0 * last as f64;
    let low = at as usize;
    let high = (low + 1).min(last);
    sorted[low] + (at - low as f64) * (sorted[high] - sorted[low])
}

/// Returns the 97.5th percentile of Student's t, which bounds 95 % on two sides; `freedom` is at
/// least 1.
pub fn t_95(freedom: usize) -> f64 {
    const FEW: [f64; 10] = [
        12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622, 2.2281,
    ];
    if let Some(t) = FEW.get(freedom - 1) {
        return *t;
    }
    // Abramowitz and Stegun, 26.7.5.
    let (z, n) = (1.959_963_985_f64, freedom as f64);
    let (z3, z5, z7) = (z.powi(3), z.powi(5), z.powi(7));
    z + (z3 + z) / (4.0 * n)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * n * n)
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * n.powi(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_match_numpy() {
        let values = [1.0, 2.0, 4.0, 8.0];
        assert_eq!(percentile(&values, 50.0), 3.0);
        assert_eq!(percentile(&values, 0.0), 1.0);
        assert_eq!(percentile(&values, 100.0), 8.0);
        assert!((percentile(&values, 95.0) - 7.4).abs() < 1e-12);
    }

    #[test]
    fn spreads_leave_undefined_trials_out() {
        let planned = [("a".to_owned(), Some(1.0))];
        let trials = [(0, vec![Some(1.0)]), (1, vec![None]), (2, vec![Some(3.0)])];
        let spread = &spreads(&planned, &trials)[0];
        assert_eq!((spread.mean, spread.defined), (Some(2.0), 2));
        assert!(spread.deviation.is_some_and(|d| (d - 2.0_f64.sqrt()).abs() < 1e-12));
    }

    /// Guards against NaN from one trial.
    #[test]
    fn one_trial_has_no_deviation_and_none_has_no_mean() {
        let planned = [("a".to_owned(), Some(1.0))];
        let one = &spreads(&planned, &[(0, vec![Some(3.0)])])[0];
        assert_eq!((one.mean, one.deviation), (Some(3.0), None));
        assert_eq!(one.percentiles, Some([3.0; 5]));
        let none = &spreads(&planned, &[(0, vec![None])])[0];
        assert_eq!((none.mean, none.deviation, none.percentiles), (None, None, None));
    }

    /// Integrates Student's density between -t and t by Simpson's rule. The density is normalised
    /// by the same rule over the angle, `x = sqrt(n) tan(a)`, in which it is `cos(a)^(n - 1)`.
    #[test]
    fn the_interval_of_the_mean_holds_95_percent_of_students_density() {
        let simpson = |n: usize, to: f64| {
            let step = to / 20_000.0;
            let value = |i: u32| (f64::from(i) * step).cos().powi(n as i32 - 1);
            let weight = |i: u32| {
                if i == 0 || i == 20_000 {
                    1.0
                } else {
                    2.0 + 2.0 * f64::from(i % 2)
                }
            };
            (0..=20_000).map(|i| weight(i) * value(i)).sum::<f64>() * step / 3.0
        };
        for n in [1, 2, 3, 5, 10, 11, 12, 19, 30, 99, 999] {
            let angle = (t_95(n) / (n as f64).sqrt()).atan();
            let share = simpson(n, angle) / simpson(n, std::f64::consts::FRAC_PI_2);
            assert!((share - 0.95).abs() < 1e-5, "{n}: {share}");
        }
    }

    #[test]
    fn the_interval_of_the_mean_is_that_of_the_textbook() {
        let trials: Vec<_> = [1.0, 2.0, 3.0].into_iter().map(|v| (0, vec![Some(v)])).collect();
        let [low, high] = spreads(&[("a".to_owned(), None)], &trials)[0].interval.unwrap();
        // 2 ± 4.3027 / sqrt(3)
        assert!(
            (low + 0.484_15).abs() < 1e-4 && (high - 4.484_15).abs() < 1e-4,
            "{low} {high}"
        );
    }
}
