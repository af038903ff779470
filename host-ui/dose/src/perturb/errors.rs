//! Errors of the seeds of an implant: of each seed, of a strand, of the whole implant, and loss.

use crate::seed::Seed;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};

/// Errors of the places of seeds, all normal and in m, and their loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Standard deviation of each seed along each of the three axes.
    pub sigma_m: f64,
    /// Standard deviation along the axis of the seed, if it differs from `sigma_m`, which then
    /// applies across the axis. A seed without an axis has `sigma_m` in every direction.
    pub along_m: Option<f64>,
    /// Correlation of the errors of two seeds of one strand, 0 to 1.
    pub within_strand: f64,
    /// Shift of all seeds in every trial.
    pub shift_m: [f64; 3],
    /// Standard deviation, along each axis, of a shift common to all seeds of a trial.
    pub shift_sigma_m: f64,
    /// Probability that a seed is lost, independently of the others.
    pub loss: f64,
}

/// Streams of random numbers of one trial. The numbers of one error do not depend on whether
/// another is requested.
#[derive(Clone, Copy)]
enum Stream {
    Seed,
    Strand,
    Implant,
    Loss,
}

impl Errors {
    /// Creates independent errors along each axis.
    pub const fn of_sigma(sigma_m: f64) -> Self {
        Self {
            sigma_m,
            along_m: None,
            within_strand: 0.0,
            shift_m: [0.0; 3],
            shift_sigma_m: 0.0,
            loss: 0.0,
        }
    }

    pub(super) fn apply(&self, plan: &[Seed], strands: &[usize], random_seed: u64, trial: usize) -> Vec<Seed> {
        let random = |stream: Stream| {
            let mut random = ChaCha8Rng::seed_from_u64(random_seed);
            random.set_stream(trial as u64 | (stream as u64) << 56);
            random
        };
        let mut own = random(Stream::Seed);
        let mut of_implant = random(Stream::Implant);
        let mut loss = random(Stream::Loss);
        let mut of_strand = random(Stream::Strand);
        let common = normal(&mut of_implant);
        let count = strands.iter().max().map_or(0, |last| last + 1);
        let of_strands: Vec<[f64; 3]> = (0..count).map(|_| normal(&mut of_strand)).collect();
        let (together, alone) = (self.within_strand.sqrt(), (1.0 - self.within_strand).sqrt());
        let place = |(i, seed): (usize, &Seed)| {
            let mut error = normal(&mut own);
            if let Some(strand) = strands.get(i).filter(|_| self.within_strand > 0.0) {
                let shared = of_strands[*strand];
                error = [0, 1, 2].map(|a| alone * error[a] + together * shared[a]);
            }
            let error_m = self.scaled(error, seed.axis);
            let share: f64 = StandardUniform.sample(&mut loss);
            let shift = |a: usize| self.shift_m[a] + self.shift_sigma_m * common[a];
            (share >= self.loss).then(|| Seed {
                position_m: [0, 1, 2].map(|a| seed.position_m[a] + error_m[a] + shift(a)),
                ..*seed
            })
        };
        plan.iter().enumerate().filter_map(place).collect()
    }

    /// Scales normal numbers of deviation 1 to an error, with its own deviation along the axis.
    fn scaled(&self, normal: [f64; 3], axis: Option<[f64; 3]>) -> [f64; 3] {
        let error_m = normal.map(|n| self.sigma_m * n);
        let (Some(along_m), Some(axis)) = (self.along_m, axis) else {
            return error_m;
        };
        let part: f64 = (0..3).map(|a| normal[a] * axis[a]).sum();
        [0, 1, 2].map(|a| error_m[a] + (along_m - self.sigma_m) * part * axis[a])
    }
}

fn normal(random: &mut ChaCha8Rng) -> [f64; 3] {
    [(); 3].map(|()| StandardNormal.sample(random))
}

#[cfg(test)]
mod tests;
