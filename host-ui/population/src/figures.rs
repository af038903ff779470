//! Distributions of the results of insertions, and influences on their misplacement.

use crate::dose::{Covered, Scored};
use nalgebra::Vector3;
use stylet_implant::plan::{SEED_LENGTH_M, TOUCHING_M};
use stylet_insertions::{Insertion, Motion, Seed, Table};

/// Fewest values with a histogram and with percentiles of their tails.
pub const MANY: usize = 20;

/// Sorted values of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution {
    /// Name for people.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Item with one value: a seed, an insertion, an implant.
    pub each: &'static str,
    /// Values, ascending.
    pub values: Vec<f64>,
}

impl Distribution {
    /// Creates a distribution of values in any order.
    pub fn new(name: &'static str, unit: &'static str, each: &'static str, mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        Self {
            name,
            unit,
            each,
            values,
        }
    }

    /// Returns the mean; `None` without values.
    pub fn mean(&self) -> Option<f64> {
        let count = self.values.len();
        (count > 0).then(|| self.values.iter().sum::<f64>() / count as f64)
    }

    /// Returns the standard deviation of a sample; `None` for fewer than two values.
    pub fn deviation(&self) -> Option<f64> {
        let (mean, count) = (self.mean()?, self.values.len());
        let square = self.values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        (count > 1).then(|| (square / (count - 1) as f64).sqrt())
    }

    /// Returns a percentile, linear between neighbours; `None` without values.
    pub fn percentile(&self, percent: f64) -> Option<f64> {
        let last = self.values.len().checked_sub(1)?;
        let at = (percent / 100.0).clamp(0.0, 1.0) * last as f64;
        let (low, share) = (at as usize, at.fract());
        let high = self.values[(low + 1).min(last)];
        Some(self.values[low] + (high - self.values[low]) * share)
    }

    /// Returns the range for display: percentiles 5 and 95, or of few values all.
    pub fn range(&self) -> [(&'static str, Option<f64>); 2] {
        let ends = match self.values.len() < MANY {
            true => [("smallest", 0.0), ("largest", 100.0)],
            false => [("p5", 5.0), ("p95", 95.0)],
        };
        ends.map(|(name, percent)| (name, self.percentile(percent)))
    }
}

/// Returns the room between the ends of neighbours of one needle at rest, mm.
pub fn gaps_mm<'a>(rows: impl IntoIterator<Item = &'a Insertion>) -> Vec<f64> {
    let pairs = rows.into_iter().flat_map(|row| row.seeds.windows(2));
    let gap_mm = |pair: &[Seed]| {
        let [one, next] = [pair[0].rest?, pair[1].rest?].map(|rest| Vector3::from(rest.at_mm));
        Some((one - next).norm() - 1e3 * SEED_LENGTH_M)
    };
    pairs.filter_map(gap_mm).collect()
}

/// Returns how many pairs of neighbours touch.
pub fn touching(gaps_mm: &[f64]) -> usize {
    gaps_mm.iter().filter(|gap_mm| **gap_mm < 1e3 * TOUCHING_M).count()
}

/// Returns all distributions, in the order of the page.
pub fn figures(table: &Table, scored: &Scored) -> Vec<Distribution> {
    let seeds = |n: usize| {
        let all = table.rows.iter().flat_map(|row| &row.seeds);
        all.filter_map(|seed| Some(seed.misplacement_mm()?[n])).collect()
    };
    let motions = |of: fn(&Motion) -> f64| {
        table
            .rows
            .iter()
            .filter_map(|row| row.outcome.as_ref().ok())
            .map(of)
            .collect()
    };
    let implants = |of: fn(&Covered) -> f64| scored.implants.iter().map(|i| of(&i.delivered)).collect();
    let (largest, percent) = ("Largest displacement of tissue", "% of the prescription");
    let all = [
        Distribution::new("Seed misplacement", "mm", "seed", seeds(0)),
        Distribution::new("Along the needle, + too deep", "mm", "seed", seeds(1)),
        Distribution::new("Gap between neighbours on a needle", "mm", "pair", gaps_mm(&table.rows)),
        Distribution::new("Shift of the gland", "mm", "insertion", motions(|m| m.target_shift_mm)),
        Distribution::new(largest, "mm", "insertion", motions(|m| m.largest_displacement_mm)),
        Distribution::new("Peak force on the hand", "N", "insertion", motions(|m| m.peak_force_n)),
        Distribution::new("Duration of an insertion", "s", "insertion", motions(|m| m.duration_s)),
        Distribution::new("D90 of the implant", percent, "implant", implants(|c| c.d90_percent)),
        Distribution::new(
            "V100 of the implant",
            "% of the target",
            "implant",
            implants(|c| c.v100_percent),
        ),
    ];
    all.into_iter().filter(|d| !d.values.is_empty()).collect()
}

/// Returns the mean misplacement of the seeds of one needle, mm.
pub fn mean_misplacement_mm(row: &Insertion) -> Option<f64> {
    let seeds: Vec<f64> = row.seeds.iter().filter_map(|s| Some(s.misplacement_mm()?[0])).collect();
    (!seeds.is_empty()).then(|| seeds.iter().sum::<f64>() / seeds.len() as f64)
}

/// Returns the varied quantities with their rank correlation (Spearman) to the mean misplacement of
/// a needle, strongest first.
pub fn influences(table: &Table) -> Vec<(String, f64)> {
    let rows: Vec<(&Insertion, f64)> = table
        .rows
        .iter()
        .filter_map(|r| Some((r, mean_misplacement_mm(r)?)))
        .collect();
    let misplaced = ranks(&rows.iter().map(|(_, m)| *m).collect::<Vec<_>>());
    let of = |(n, name): (usize, &String)| {
        let values: Vec<f64> = rows.iter().map(|(row, _)| row.drawn[n]).collect();
        Some((name.clone(), correlation(&ranks(&values), &misplaced)?))
    };
    let mut found: Vec<(String, f64)> = table.quantities.iter().enumerate().filter_map(of).collect();
    found.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    found
}

/// Returns the rank of each value; equal ones share the mean of their ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for same in order.chunk_by(|&a, &b| values[a] == values[b]) {
        let mean = first as f64 + 0.5 * (same.len() - 1) as f64;
        same.iter().for_each(|&n| ranks[n] = mean);
        first += same.len();
    }
    ranks
}

/// Returns Pearson's correlation; `None` if one of both does not vary.
fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let sum = |of: &dyn Fn(f64, f64) -> f64| a.iter().zip(b).map(|(x, y)| of(x - ma, y - mb)).sum::<f64>();
    let width = (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt();
    (a.len() > 2 && width > 0.0).then(|| sum(&|x, y| x * y) / width)
}
