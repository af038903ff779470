//! Robustness of a plan: many trials with seeds moved at random, and the spread of their measures.

mod errors;
mod spread;

pub use errors::Errors;
pub use spread::{PERCENTILES, Spread, spreads, t_95};

use super::edema::Swelling;
use super::kernel::DoseKernel;
use super::report::Judge;
use super::seed::Seed;
use rayon::prelude::*;

/// Random displacement of seeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// Errors of the seeds.
    pub errors: Errors,
    /// Number of trials.
    pub trials: usize,
    /// Seed of the random numbers: equal seeds give equal trials, on any number of threads.
    pub random_seed: u64,
}

/// Plan before its perturbation.
#[derive(Clone, Copy, Debug)]
pub struct Planned<'a> {
    /// Seeds at their planned places.
    pub seeds: &'a [Seed],
    /// Strand of each seed; empty if each seed is single.
    pub strands: &'a [usize],
    /// Swelling of the gland, with which the seeds move.
    pub swelling: Option<Swelling>,
}

/// Returns the values of every finished trial, by its number. The work ends early once `stop` returns true; `done` is
/// called after each trial.
pub fn trials(
    judge: &Judge,
    kernel: &DoseKernel,
    plan: Planned<'_>,
    how: Perturbation,
    stop: impl Fn() -> bool + Sync,
    done: impl Fn() + Sync,
) -> Vec<(usize, Vec<Option<f64>>)> {
    (0..how.trials)
        .into_par_iter()
        .filter_map(|trial| {
            if stop() {
                return None;
            }
            let moved = moved(plan.seeds, plan.strands, how, trial);
            let values = judge.values(&judge.judge_swollen(kernel, &moved, plan.swelling));
            done();
            Some((trial, values.into_iter().map(|(_, v)| v).collect()))
        })
        .collect()
}

/// Returns the seeds of one trial, which has its own streams of random numbers. `strands` as in
/// [`Planned`].
pub fn moved(plan: &[Seed], strands: &[usize], how: Perturbation, trial: usize) -> Vec<Seed> {
    how.errors.apply(plan, strands, how.random_seed, trial)
}
