//! Rehearsals of one needle: drops, and the places of their seeds.

use super::Limits;
use crate::plan::rehearse::{Drops, RehearsalError, Rehearser, Rest};
use crate::plan::{Loading, Needle};
use nalgebra::Vector3;
use stylet_procedure::Pace;

/// Smallest distance between successive drops of one needle.
const APART_M: f64 = 0.1e-3;

/// Needle, and its rehearser.
pub(super) struct Rehearsals<'a> {
    pub needle: &'a Needle,
    pub pace: &'a Pace,
    pub limits: &'a Limits,
    pub rehearser: &'a mut dyn Rehearser,
    /// Number of rehearsals so far.
    pub count: usize,
}

/// Place of a seed when it was left, and at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SeedAtRest {
    /// Place at which the needle left its middle, from the entry along the needle, m.
    pub tip_m: f64,
    /// Place at rest, m.
    pub rest_m: Vector3<f64>,
}

impl Rehearsals<'_> {
    pub fn try_it(&mut self, drops: Drops) -> Result<RehearsedDrops, RehearsalError> {
        let left = self.left(&drops, false)?;
        let off = |(left, planned): (&SeedAtRest, [f64; 3])| left.rest_m - Vector3::from(planned);
        Ok(RehearsedDrops {
            error_m: left.iter().zip(self.needle.seeds_m()).map(off).collect(),
            left,
            drops,
        })
    }

    /// Returns the places of the seeds, in the order of the drops; they take no room if they are `as_points`.
    pub fn left(&mut self, drops: &Drops, as_points: bool) -> Result<Vec<SeedAtRest>, RehearsalError> {
        self.count += 1;
        let Rest {
            seeds_m, dropped_at_m, ..
        } = self.rehearser.rehearse(drops, self.pace, as_points)?;
        let (entry_m, direction) = (Vector3::from(drops.entry_m), Vector3::from(drops.direction));
        let each = seeds_m.into_iter().zip(dropped_at_m);
        Ok(each
            .map(|(rest_m, tip_m)| SeedAtRest {
                tip_m: (Vector3::from(tip_m) - entry_m).dot(&direction),
                rest_m: rest_m.into(),
            })
            .collect())
    }
}

/// Rehearsed drops, and the errors of their seeds.
#[derive(Clone)]
pub(super) struct RehearsedDrops {
    pub drops: Drops,
    pub left: Vec<SeedAtRest>,
    /// Rest minus plan.
    pub error_m: Vec<Vector3<f64>>,
}

impl RehearsedDrops {
    pub fn mean_m(&self) -> f64 {
        self.error_m.iter().map(Vector3::norm).sum::<f64>() / self.error_m.len().max(1) as f64
    }

    pub fn worst_m(&self) -> f64 {
        self.error_m.iter().map(Vector3::norm).fold(0.0, f64::max)
    }

    /// Returns the error of a seed along the needle, positive if too deep; for a strand, of all of
    /// it.
    pub fn off_m(&self, needle: &Needle, seed: usize) -> f64 {
        let direction = Vector3::from(needle.direction);
        let along = |e: &Vector3<f64>| e.dot(&direction);
        match needle.loading {
            Loading::Loose => self.error_m.get(seed).map_or(0.0, along),
            Loading::Stranded { .. } => median(self.error_m.iter().map(along).collect()),
        }
    }
}

/// Returns the median error of a strand: shifted by it, its seeds have the smallest mean error.
fn median(mut off_m: Vec<f64>) -> f64 {
    off_m.sort_by(f64::total_cmp);
    let n = off_m.len();
    match n {
        0 => 0.0,
        _ => 0.5 * (off_m[(n - 1) / 2] + off_m[n / 2]),
    }
}

/// Restricts drops to the neighbourhood of the plan and the reach of the tip, deepest first: a drop
/// must not need the tip to go in again.
pub(super) fn keep_within(needle: &Needle, limits: &Limits, drops: &mut Drops) {
    for (along_m, planned) in drops.along_m.iter_mut().zip(&needle.seeds) {
        let [least, most] = [planned.along_m - limits.along_m, planned.along_m + limits.along_m];
        *along_m = along_m.clamp(least.max(0.0), most.min(limits.reach_m).max(least.max(0.0)));
    }
    for i in 1..drops.along_m.len() {
        drops.along_m[i] = drops.along_m[i].min(drops.along_m[i - 1] - APART_M);
    }
}

/// Shifts the needle across by the mean error of its seeds; for a negligible one it stays in place,
/// where the tissue is prepared.
pub(super) fn aside(needle: &Needle, last: &RehearsedDrops, limits: &Limits, drops: &mut Drops) {
    let direction = Vector3::from(needle.direction);
    let sum = last.error_m.iter().fold(Vector3::zeros(), |sum, e| sum + e);
    let mean = sum / last.error_m.len().max(1) as f64;
    let across = mean - direction * mean.dot(&direction);
    if across.norm() < 0.5 * limits.enough_m {
        drops.entry_m = last.drops.entry_m;
        return;
    }
    let shifted = Vector3::from(last.drops.entry_m) - across - Vector3::from(needle.entry_m);
    let size = shifted.norm();
    let kept = if size > limits.across_m {
        shifted * (limits.across_m / size)
    } else {
        shifted
    };
    drops.entry_m = (Vector3::from(needle.entry_m) + kept).into();
}
