//! What seeds that miss their places do: many plans with seeds moved at random, and how their measures spread.

use super::kernel::DoseKernel;
use super::report::Judge;
use super::seed::Seed;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;
use stylet_base::interrupt::Interrupt;

/// How seeds are moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// Standard deviation of each seed along each of the three axes.
    pub sigma_m: f64,
    /// Number of trials.
    pub trials: usize,
    /// The same number gives the same trials, on any number of threads.
    pub random_seed: u64,
}

/// One measure over all trials, in its unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// Name and unit of the measure.
    pub name: String,
    /// Of the plan as it is.
    pub planned: Option<f64>,
    /// `None` where the measure is defined in no trial.
    pub mean: Option<f64>,
    /// Standard deviation of a sample; `None` for fewer than two trials.
    pub deviation: Option<f64>,
    /// The 5th, 25th, 50th, 75th and 95th percentile; `None` where the measure is defined in no trial.
    pub percentiles: Option<[f64; 5]>,
    /// Trials in which the measure is defined; the figures above are of these.
    pub defined: usize,
}

/// The percentiles of a [`Spread`].
pub const PERCENTILES: [f64; 5] = [5.0, 25.0, 50.0, 75.0, 95.0];

/// Values of every trial that was done, by its number; `stop` ends the work early, `done` is called after each trial.
pub fn trials(
    judge: &Judge,
    kernel: &DoseKernel,
    plan: &[Seed],
    how: Perturbation,
    stop: &Interrupt,
    done: impl Fn() + Sync,
) -> Vec<(usize, Vec<Option<f64>>)> {
    (0..how.trials)
        .into_par_iter()
        .filter_map(|trial| {
            if stop.asked() {
                return None;
            }
            let moved = moved(plan, how, trial);
            let values = judge.values(&judge.judge(kernel, &moved));
            done();
            Some((trial, values.into_iter().map(|(_, v)| v).collect()))
        })
        .collect()
}

/// The plan of one trial; each trial has a stream of random numbers of its own.
pub fn moved(plan: &[Seed], how: Perturbation, trial: usize) -> Vec<Seed> {
    let mut random = ChaCha8Rng::seed_from_u64(how.random_seed);
    random.set_stream(trial as u64);
    // Fails for a deviation that is not a number only; then nothing moves.
    let error = Normal::new(0.0, how.sigma_m).ok();
    plan.iter()
        .map(|seed| Seed {
            position_m: seed
                .position_m
                .map(|p| p + error.map_or(0.0, |error| error.sample(&mut random))),
            ..*seed
        })
        .collect()
}

/// Mean, deviation and percentiles of each measure.
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
            Spread {
                name: name.clone(),
                planned: *value,
                mean: last.map(|_| mean),
                deviation: last.filter(|&l| l > 0).map(|_| (square / (count - 1.0)).sqrt()),
                percentiles: last.map(|_| PERCENTILES.map(|p| percentile(&values, p))),
                defined: values.len(),
            }
        })
        .collect()
}

/// Linear between the sorted values (Hyndman and Fan's type 7), of which there is at least one.
fn percentile(sorted: &[f64], percent: f64) -> f64 {
    let last = sorted.len() - 1;
    let at = percent / 100.0 * last as f64;
    let low = at as usize;
    let high = (low + 1).min(last);
    sorted[low] + (at - low as f64) * (sorted[high] - sorted[low])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_lie_between_the_values_as_numpy_puts_them() {
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

    /// One trial printed NaN.
    #[test]
    fn one_trial_has_no_deviation_and_none_has_no_mean() {
        let planned = [("a".to_owned(), Some(1.0))];
        let one = &spreads(&planned, &[(0, vec![Some(3.0)])])[0];
        assert_eq!((one.mean, one.deviation), (Some(3.0), None));
        assert_eq!(one.percentiles, Some([3.0; 5]));
        let none = &spreads(&planned, &[(0, vec![None])])[0];
        assert_eq!((none.mean, none.deviation, none.percentiles), (None, None, None));
    }

    #[test]
    fn moves_have_the_deviation_asked_for_along_each_axis_and_keep_the_rest() {
        let seed = Seed {
            position_m: [0.01, 0.02, 0.03],
            axis: Some([0.0, 0.0, 1.0]),
            strength_u: 0.5,
        };
        let how = Perturbation {
            sigma_m: 4e-3,
            trials: 1,
            random_seed: 7,
        };
        let moved = moved(&vec![seed; 20_000], how, 3);
        for a in 0..3 {
            let off: Vec<f64> = moved.iter().map(|m| m.position_m[a] - seed.position_m[a]).collect();
            let mean = off.iter().sum::<f64>() / off.len() as f64;
            let sigma = (off.iter().map(|o| (o - mean).powi(2)).sum::<f64>() / off.len() as f64).sqrt();
            // Four standard errors.
            assert!(mean.abs() < 4.0 * 4e-3 / 141.0, "mean {mean}");
            assert!((sigma / 4e-3 - 1.0).abs() < 4.0 / 200.0, "sigma {sigma}");
        }
        assert!(
            moved
                .iter()
                .all(|m| m.axis == seed.axis && m.strength_u == seed.strength_u)
        );
        assert_ne!(moved[0].position_m, super::moved(&[seed], how, 4)[0].position_m);
    }
}
