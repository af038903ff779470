//! Extrapolates the lateness of wake-ups to a longer run: peaks over a threshold, only if the data permit it.
//!
//! The method: the latest wake-ups over a threshold, one for each cluster (Ferro and Segers 2003), a generalised Pareto
//! distribution by maximum likelihood, and levels with intervals by profile likelihood (Coles 2001, section 4.3). Every
//! assumption is tested first; if one fails, the result is the reason with its figure instead of a level.

mod cluster;
mod fit_test;
mod pareto;

use crate::sample::{LARGEST, Sample};
use crate::stationary::{self, Stationarity, TestResult};
use cluster::decluster;
use pareto::{Pareto, interval};
use serde::Serialize;

/// Inverse fraction of the wake-ups over the threshold, and their largest number.
const SHARE_OVER: u64 = 50;
const MOST_OVER: usize = LARGEST / 2;
/// Clusters that a fit needs.
const FEWEST_CLUSTERS: usize = 100;
/// Longest extrapolation, in lengths of the run.
const FARTHEST: f64 = 100.0;
/// Probability below which the fit is refused.
const FIT_LEVEL: f64 = 0.05;

/// A wake-up latency exceeded on average once in a given time.
#[derive(Clone, Debug, Serialize)]
pub struct ReturnLevel {
    pub every_s: f64,
    pub us: f64,
    /// 95 % interval by profile likelihood.
    pub interval_us: [f64; 2],
}

/// The distribution of the excesses over the threshold.
#[derive(Clone, Debug, Serialize)]
pub struct Tail {
    pub threshold_us: f64,
    pub exceedances: usize,
    pub clusters: usize,
    /// One if exceedances do not cluster.
    pub extremal_index: f64,
    pub scale_us: f64,
    /// Above zero the tail has no end.
    pub shape: f64,
    /// Anderson-Darling statistic of the fit.
    pub anderson_darling: f64,
    /// Largest value of the statistic at 5 % (Choulakian and Stephens 2001, table 2).
    pub anderson_darling_5_percent: f64,
}

/// Extrapolation from a run to wake-ups later than any observed.
#[derive(Clone, Debug, Serialize)]
pub struct Extremes {
    pub stationarity: Stationarity,
    pub tests_of_the_tail: Vec<TestResult>,
    pub tail: Option<Tail>,
    pub levels: Vec<ReturnLevel>,
    /// Reasons why there are no levels; empty if there are.
    pub not_applicable_because: Vec<String>,
}

/// Examines the wake-ups of a loop with `rate_hz` grid points a second.
pub fn examine(sample: &Sample, rate_hz: f64) -> Extremes {
    let stationarity = stationary::examine(&sample.series, sample.stride);
    let mut found = Extremes {
        not_applicable_because: stationarity.against.clone(),
        stationarity,
        tests_of_the_tail: Vec::new(),
        tail: None,
        levels: Vec::new(),
    };
    let fitted = fit(sample, &mut found);
    match fitted {
        Ok(Some((tail, pareto))) if found.not_applicable_because.is_empty() => {
            match levels(&tail, &pareto, sample.grid, rate_hz) {
                Ok(levels) => found.levels = levels,
                Err(why) => found.not_applicable_because.push(why),
            }
            found.tail = Some(tail);
        }
        Ok(fitted) => found.tail = fitted.map(|(tail, _)| tail),
        Err(why) => found.not_applicable_because.push(why),
    }
    found
}

/// Returns the tail over its threshold with the fitted distribution in nanoseconds; an error names what is missing.
fn fit(sample: &Sample, found: &mut Extremes) -> Result<Option<(Tail, Pareto)>, String> {
    let largest = sample.largest();
    let wanted = (sample.grid / SHARE_OVER).min(MOST_OVER as u64) as usize;
    let mut sorted: Vec<u64> = largest.iter().map(|(_, ns)| *ns).collect();
    sorted.sort_unstable_by(|a, b| b.cmp(a));
    // The first value not over the threshold is the threshold.
    let Some(&threshold) = sorted.get(wanted).filter(|_| wanted >= FEWEST_CLUSTERS) else {
        return Err(format!(
            "{wanted} wake-ups over a threshold of one in {SHARE_OVER}, a fit needs {FEWEST_CLUSTERS}"
        ));
    };
    let over: Vec<(u64, u64)> = largest.into_iter().filter(|(_, ns)| *ns > threshold).collect();
    let (clusters, index) = decluster(&over);
    if clusters.len() < FEWEST_CLUSTERS {
        return Err(format!(
            "{} wake-ups over the threshold in {} clusters (extremal index {index:.2}), a fit needs {FEWEST_CLUSTERS}",
            over.len(),
            clusters.len()
        ));
    }
    let excesses: Vec<f64> = clusters.iter().map(|(_, ns)| (ns - threshold) as f64).collect();
    found.tests_of_the_tail = tail_tests(&clusters, &excesses, sample.grid);
    let rejected = found
        .tests_of_the_tail
        .iter()
        .filter(|t| t.rejects())
        .map(TestResult::said);
    found.not_applicable_because.extend(rejected);
    let pareto = Pareto::fit(&excesses);
    let Some(limit) = fit_test::five_percent_point(pareto.shape) else {
        found.not_applicable_because.push(format!(
            "the shape of the tail is {:.2}, and the test of the fit is known from -0.5 to 0.9",
            pareto.shape
        ));
        return Ok(None);
    };
    let statistic = fit_test::anderson_darling(&excesses, &pareto);
    if statistic > limit {
        found.not_applicable_because.push(format!(
            "the tail has another shape than the fitted one: Anderson-Darling {statistic:.2}, at most {limit:.2} at {FIT_LEVEL}"
        ));
    }
    let tail = Tail {
        threshold_us: threshold as f64 / 1e3,
        exceedances: over.len(),
        clusters: clusters.len(),
        extremal_index: index,
        scale_us: pareto.scale / 1e3,
        shape: pareto.shape,
        anderson_darling: statistic,
        anderson_darling_5_percent: limit,
    };
    Ok(Some((tail, Pareto { excesses, ..pareto })))
}

/// Tests whether clusters arrive evenly over the run, and are as large in its second half as in its first.
fn tail_tests(clusters: &[(u64, u64)], excesses: &[f64], grid: u64) -> Vec<TestResult> {
    let places: Vec<f64> = clusters
        .iter()
        .map(|(place, _)| (*place as f64 + 0.5) / grid as f64)
        .collect();
    let half = clusters.partition_point(|(place, _)| *place < grid / 2);
    vec![
        stationary::uniform("times of the late wake-ups, against evenly spread ones", &places),
        stationary::two_samples(
            "late wake-ups of the first half against the second",
            &excesses[..half],
            &excesses[half..],
        ),
    ]
}

/// Returns levels for ten runs, an hour and a day, as far as the run permits.
fn levels(tail: &Tail, pareto: &Pareto, grid: u64, rate_hz: f64) -> Result<Vec<ReturnLevel>, String> {
    let run_s = grid as f64 / rate_hz;
    let mut every_s: Vec<f64> = vec![10.0 * run_s];
    every_s.extend(
        [3_600.0, 86_400.0]
            .into_iter()
            .filter(|s| *s > run_s && *s <= FARTHEST * run_s),
    );
    every_s.sort_by(f64::total_cmp);
    let clusters_per_s = tail.clusters as f64 / run_s;
    let level = |every_s: f64| {
        let Some((at, low, high)) = interval(pareto, every_s * clusters_per_s) else {
            return Err(format!(
                "the level for {every_s:.0} s has no upper end at 95 % confidence (shape {:.2}, {} clusters)",
                tail.shape, tail.clusters
            ));
        };
        let us = |excess_ns: f64| tail.threshold_us + excess_ns / 1e3;
        Ok(ReturnLevel {
            every_s,
            us: us(at),
            interval_us: [us(low), us(high)],
        })
    };
    every_s.into_iter().map(level).collect()
}

#[cfg(test)]
mod tests;
