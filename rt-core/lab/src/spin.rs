//! `--spin-us auto`: finds the smallest spin before each deadline with which the loop wakes sooner than cyclictest.

use crate::compare::{self, CompareError};
use crate::measure::{MeasureError, Setup, measure};
use crate::summary::quantile_us;
use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, Ordering};
use stylet_runtime::process::Options;
use stylet_runtime::rt::clock::Wait;

/// Largest ratio of the loop's p50 and p99 to cyclictest's: a third, so that a factor of two remains on a slightly
/// worse day.
const SHARE: f64 = 1.0 / 3.0;
/// Consecutive trials that must meet it: a percentile of three seconds may be low by chance.
const TRIALS: usize = 2;
/// Each trial brings p99 with ten samples beyond it at 1 kHz.
const TRIAL_NS: u64 = 3_000_000_000;
const FIRST_US: u64 = 10;
/// Resolution of the spin.
const STEP_US: u64 = 5;

/// `--spin-us` as given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spin {
    /// Fixed number of microseconds.
    Fixed(u64),
    /// Number to be found.
    Auto,
}

impl std::str::FromStr for Spin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            _ => text
                .parse()
                .map(Self::Fixed)
                .map_err(|_| "expected microseconds, or auto".to_owned()),
        }
    }
}

/// One trial.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Trial {
    pub spin_us: u64,
    pub p50_us: Option<f64>,
    pub p99_us: Option<f64>,
    /// Both percentiles are low enough.
    pub met: bool,
}

/// Spins tried, and the result.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SpinSearch {
    /// p50 and p99 that the loop must not exceed, microseconds.
    pub at_most_us: [f64; 2],
    pub trials: Vec<Trial>,
    /// `None` if no spin is enough: the longest one tried is then used.
    pub found_us: Option<u64>,
    pub used_us: u64,
    /// Largest fraction of the core taken by spinning.
    pub core_share: f64,
}

impl SpinSearch {
    /// Returns the result and its cost, in words.
    pub fn words(&self) -> String {
        let [p50, p99] = self.at_most_us;
        let share = 100.0 * self.core_share;
        match self.found_us {
            Some(us) => format!(
                "a spin of {us} us brings p50 to at most {p50:.1} us and p99 to at most {p99:.1} us; it takes up to {share:.1} % of the core"
            ),
            None => format!(
                "no spin up to {} us brings p50 to at most {p50:.1} us and p99 to at most {p99:.1} us; the longest is used, which takes up to {share:.1} % of the core",
                self.used_us
            ),
        }
    }
}

/// Reason why no spin could be searched for.
#[derive(Debug, thiserror::Error)]
pub enum SpinError {
    /// The comparison with cyclictest failed.
    #[error("--spin-us auto: {0}")]
    Compare(#[from] CompareError),
    /// A trial failed.
    #[error("--spin-us auto: {0}")]
    Measure(#[from] MeasureError),
    /// Too few values to compare.
    #[error("--spin-us auto: cyclictest gave too few samples")]
    TooFew,
}

/// Searches with trials of three seconds; `longest_us` is the longest spin that the kernel's share permits.
pub fn search(setup: &Setup, longest_us: u64, interrupted: &AtomicBool) -> Result<SpinSearch, SpinError> {
    let setup = Setup::new(setup.options, TRIAL_NS, setup.load, setup.folder);
    let theirs = compare::cyclictest_turn(&setup, interrupted)?;
    let at = |h: &Histogram<u64>, q| quantile_us(h, q);
    let (Some(p50), Some(p99)) = (at(&theirs, 0.5), at(&theirs, 0.99)) else {
        return Err(SpinError::TooFew);
    };
    let at_most_us = [SHARE * p50, SHARE * p99];
    let mut trials = Vec::new();
    let mut failed = None;
    let mut is_met = |spin_us| {
        // SYNC: set by a signal handler; nothing but the flag is carried.
        if failed.is_some() || interrupted.load(Ordering::Acquire) {
            return false;
        }
        let options = Options {
            wait: Wait {
                spin_ns: spin_us * 1_000,
                ..setup.options.wait
            },
            ..setup.options.clone()
        };
        let ours = measure(
            &Setup {
                options: &options,
                ..setup
            },
            interrupted,
        )
        .map(|m| m.haptic.wake.whole);
        let Ok(ours) = ours.map_err(|why| failed = Some(why)) else {
            return false;
        };
        let (p50_us, p99_us) = (at(&ours, 0.5), at(&ours, 0.99));
        let low = |us: Option<f64>, most: f64| us.is_some_and(|us| us <= most);
        let met = low(p50_us, at_most_us[0]) && low(p99_us, at_most_us[1]);
        trials.push(Trial {
            spin_us,
            p50_us,
            p99_us,
            met,
        });
        met
    };
    let found_us = smallest(longest_us, |spin_us| (0..TRIALS).all(|_| is_met(spin_us)));
    if let Some(why) = failed {
        return Err(why.into());
    }
    let used_us = found_us.unwrap_or_else(|| trials.iter().map(|t| t.spin_us).max().unwrap_or(0));
    Ok(SpinSearch {
        at_most_us,
        trials,
        found_us,
        used_us,
        core_share: used_us as f64 * 1e3 / setup.options.haptic_period_ns as f64,
    })
}

/// Returns the smallest spin for which `is_met`, if a longer one is never worse: doubled until met, then bisected.
fn smallest(longest_us: u64, mut is_met: impl FnMut(u64) -> bool) -> Option<u64> {
    let (mut low, mut high) = (0, FIRST_US.min(longest_us));
    while !is_met(high) {
        if high >= longest_us {
            return None;
        }
        (low, high) = (high, (2 * high).min(longest_us));
    }
    while high - low > STEP_US {
        let middle = (low + high).div_ceil(2);
        if is_met(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_spin_is_found_to_a_step_with_few_trials() {
        for needed in [1, 9, 33, 57, 200, 333] {
            let mut trials = 0;
            let found = smallest(400, |us| {
                trials += 1;
                us >= needed
            });
            let found = found.expect("400 is enough");
            assert!(
                found >= needed && found < needed + STEP_US.max(1) + 1,
                "{found} for {needed}"
            );
            assert!(trials <= 13, "{trials} trials for {needed}");
        }
        assert_eq!(smallest(100, |us| us > 150), None);
        assert_eq!(smallest(3, |us| us >= 3), Some(3));
    }

    #[test]
    fn a_spin_is_a_number_or_auto() {
        assert_eq!("60".parse(), Ok(Spin::Fixed(60)));
        assert_eq!("auto".parse(), Ok(Spin::Auto));
        assert!("fast".parse::<Spin>().is_err() && "-1".parse::<Spin>().is_err());
    }
}
