//! Means with intervals for enough values.

use stylet_dose::perturb::t_95;

/// Fewest values with an interval.
const LEAST_FOR_INTERVAL: usize = 3;

/// Returns the mean, and from three values on the range that contains the mean of many more with a
/// probability of 95 % if they are normal and independent (Student's t); `None` without a value.
pub fn mean(values: &[f64]) -> Option<(f64, Option<[f64; 2]>)> {
    let count = values.len();
    let mean = values.iter().sum::<f64>() / count as f64;
    let interval = (count >= LEAST_FOR_INTERVAL).then(|| {
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let error = (squares / (count - 1) as f64 / count as f64).sqrt();
        let reach = t_95(count - 1) * error;
        [mean - reach, mean + reach]
    });
    (count > 0).then_some((mean, interval))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_has_an_interval_from_three_values_on() {
        assert_eq!(mean(&[]), None);
        assert_eq!(mean(&[1.0, 3.0]), Some((2.0, None)));
        // Standard deviation 1, standard error 1 / sqrt(3), t 4.303.
        let [low, high] = mean(&[1.0, 2.0, 3.0])
            .and_then(|(_, interval)| interval)
            .expect("three");
        assert!((low - (2.0 - 2.4843)).abs() < 1e-3 && (high - (2.0 + 2.4843)).abs() < 1e-3);
    }
}
