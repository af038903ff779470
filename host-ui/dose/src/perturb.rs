//! What seeds that miss their places do: many plans with seeds moved at random, and how their measures spread.

mod errors;
mod spread;

pub use errors::Errors;
pub use spread::{PERCENTILES, Spread, spreads};

use super::edema::Swelling;
use super::kernel::DoseKernel;
use super::report::Judge;
use super::seed::Seed;
use rayon::prelude::*;
use stylet_base::interrupt::Interrupt;

/// How seeds are moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// What happens to the seeds.
    pub errors: Errors,
    /// Number of trials.
    pub trials: usize,
    /// The same number gives the same trials, on any number of threads.
    pub random_seed: u64,
}

/// The plan that trials start from.
#[derive(Clone, Copy, Debug)]
pub struct Planned<'a> {
    /// The seeds where they should be.
    pub seeds: &'a [Seed],
    /// The strand of each seed; empty where each seed is alone.
    pub strands: &'a [usize],
    /// The swelling of the gland, with which the seeds move.
    pub swelling: Option<Swelling>,
}

/// Values of every trial that was done, by its number; `stop` ends the work early, `done` is called after each trial.
pub fn trials(
    judge: &Judge,
    kernel: &DoseKernel,
    plan: Planned<'_>,
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
            let moved = moved(plan.seeds, plan.strands, how, trial);
            let values = judge.values(&judge.judge_swollen(kernel, &moved, plan.swelling));
            done();
            Some((trial, values.into_iter().map(|(_, v)| v).collect()))
        })
        .collect()
}

/// The seeds of one trial; each trial has streams of random numbers of its own. `strands` as in [`Planned`].
pub fn moved(plan: &[Seed], strands: &[usize], how: Perturbation, trial: usize) -> Vec<Seed> {
    how.errors.apply(plan, strands, how.random_seed, trial)
}
