//! Distance of each seed at rest from the place that it was planned for.

use super::Shown;
use nalgebra::Vector3;
use stylet_shm_schema::{PlannedSeed, SeedPose};

/// Where a placed seed lies, seen from the planned one it was dropped for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeedError {
    /// Index in the plan.
    pub planned: usize,
    /// Index in the order of dropping; `None` while it is missing.
    pub placed: Option<usize>,
    /// Positive in the direction of insertion.
    pub along_m: f64,
    pub across_m: f64,
}

/// One row for each planned seed. A seed belongs to the nearest planned one from where it was *dropped*, nearest pairs first:
/// where it drifted later does not change which planned seed it was meant for.
pub fn seed_errors(planned: &[PlannedSeed], placed: &[SeedPose], direction: [f64; 3]) -> Vec<SeedError> {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::with_capacity(planned.len() * placed.len());
    for (i, target) in planned.iter().enumerate() {
        for (j, seed) in placed.iter().enumerate() {
            let gap = Vector3::from(seed.dropped_at_m) - Vector3::from(target.position_m);
            pairs.push((gap.norm(), i, j));
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut rows: Vec<SeedError> = (0..planned.len()).map(missing).collect();
    let mut used = vec![false; placed.len()];
    for (_, i, j) in pairs {
        if rows[i].placed.is_none() && !used[j] {
            used[j] = true;
            rows[i] = error(i, j, &planned[i], &placed[j], Vector3::from(direction));
        }
    }
    rows
}

/// Errors of the inserted needle. Seeds of a plan of many needles are dropped in its order, which identifies them where compensation drops
/// one at the place of another.
pub fn own_errors(shown: &Shown) -> Vec<SeedError> {
    let Some(plan) = &shown.plan else { return Vec::new() };
    if shown.planning.at_work().is_none() {
        return seed_errors(shown.planned(), &shown.seeds, plan.direction);
    }
    in_order(shown.planned(), shown.own_seeds(), plan.direction)
}

/// Errors of all needles that have begun, each with the number of its needle.
pub fn all_errors(shown: &Shown) -> Vec<(usize, SeedError)> {
    let Some(implant) = &shown.planning.implant else {
        return own_errors(shown).into_iter().map(|row| (0, row)).collect();
    };
    let progress = &shown.planning.progress;
    let of_needle = |number: usize| {
        let needle = &implant.plan.needles[number];
        let planned: Vec<PlannedSeed> = needle.seeds_m().map(|position_m| PlannedSeed { position_m }).collect();
        let placed = &shown.seeds[progress.seeds_of(number, shown.seeds.len())];
        let rows = in_order(&planned, placed, needle.direction);
        rows.into_iter().map(move |row| (number, row)).collect::<Vec<_>>()
    };
    (0..progress.begun().min(implant.plan.needles.len()))
        .flat_map(of_needle)
        .collect()
}

fn in_order(planned: &[PlannedSeed], placed: &[SeedPose], direction: [f64; 3]) -> Vec<SeedError> {
    let row = |(i, target): (usize, &PlannedSeed)| match placed.get(i) {
        Some(seed) => error(i, i, target, seed, Vector3::from(direction)),
        None => missing(i),
    };
    planned.iter().enumerate().map(row).collect()
}

fn missing(planned: usize) -> SeedError {
    SeedError {
        planned,
        placed: None,
        along_m: 0.0,
        across_m: 0.0,
    }
}

fn error(planned: usize, placed: usize, target: &PlannedSeed, seed: &SeedPose, direction: Vector3<f64>) -> SeedError {
    let gap = Vector3::from(seed.position_m) - Vector3::from(target.position_m);
    let along_m = gap.dot(&direction);
    SeedError {
        planned,
        placed: Some(placed),
        along_m,
        across_m: (gap - direction * along_m).norm(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_dropped_in_reverse_find_their_plan_and_drift_is_split() {
        let planned = [0.01, 0.02].map(|z| PlannedSeed {
            position_m: [0.0, 0.0, z],
        });
        let placed = [0.02, 0.01].map(|z| SeedPose {
            position_m: [0.003, 0.0, z + 0.001],
            axis: [0.0, 0.0, 1.0],
            dropped_at_m: [0.0, 0.0, z],
        });
        let rows = seed_errors(&planned, &placed, [0.0, 0.0, 1.0]);
        assert_eq!(rows[0].placed, Some(1));
        assert_eq!(rows[1].placed, Some(0));
        assert!((rows[0].along_m - 0.001).abs() < 1e-12 && (rows[0].across_m - 0.003).abs() < 1e-12);
        assert_eq!(seed_errors(&planned, &placed[..1], [0.0, 0.0, 1.0])[0].placed, None);
    }
}
