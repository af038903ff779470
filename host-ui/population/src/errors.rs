//! Placement errors of a population's seeds, as errors for trials of another plan.

use nalgebra::{Matrix3, Vector3};
use stylet_dose::perturb::Errors;
use stylet_insertions::{Insertion, Table};

/// Returns the errors of seeds, in the patient's frame; `None` for fewer than two seeds at rest.
///
/// `sigma_m` is the standard deviation across the needle, `along_m` that along it, both about the
/// mean, which is `shift_m`. `within_strand` is the correlation of the errors of two seeds of one
/// needle. A seed that no needle left does not count as lost: its needle was not inserted.
pub fn misplacement(table: &Table) -> Option<Errors> {
    let rows: Vec<Vec<(Vector3<f64>, Vector3<f64>)>> = table.rows.iter().map(of_row).collect();
    let all = || rows.iter().flatten();
    let count = all().count() as f64;
    if count < 2.0 {
        return None;
    }
    let mean_m = all().map(|(error_m, _)| error_m).sum::<Vector3<f64>>() / count;
    let (mut along, mut across) = (0.0, 0.0);
    for (error_m, axis) in all() {
        let off = error_m - mean_m;
        along += off.dot(axis).powi(2);
        across += (off - axis * off.dot(axis)).norm_squared();
    }
    // For two seeds of one needle: sums over pairs are the square of the sum without the squares.
    let (mut together, mut pairs) = (0.0, 0.0);
    for row in &rows {
        let offs = || row.iter().map(|(error_m, _)| error_m - mean_m);
        let sum: Vector3<f64> = offs().sum();
        together += sum.norm_squared() - offs().map(|off| off.norm_squared()).sum::<f64>();
        pairs += (row.len() * row.len().saturating_sub(1)) as f64;
    }
    let variance = (along + across) / count;
    let correlation = match pairs > 0.0 && variance > 0.0 {
        true => (together / pairs / variance).clamp(0.0, 1.0),
        false => 0.0,
    };
    Some(Errors {
        sigma_m: (across / 2.0 / (count - 1.0)).sqrt(),
        along_m: Some((along / (count - 1.0)).sqrt()),
        within_strand: correlation,
        shift_m: mean_m.into(),
        shift_sigma_m: 0.0,
        loss: 0.0,
    })
}

/// Returns the same errors in a frame that is rotated by `turn`, such as that of a scene.
pub fn turned(errors: Errors, turn: &Matrix3<f64>) -> Errors {
    Errors {
        shift_m: (turn * Vector3::from(errors.shift_m)).into(),
        ..errors
    }
}

/// Returns the error of each seed at rest, m, with the axis of its needle.
fn of_row(row: &Insertion) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let of_seed = |seed: &stylet_insertions::Seed| {
        let rest_mm = Vector3::from(seed.rest.as_ref()?.at_mm);
        let error_m = (rest_mm - Vector3::from(seed.planned_mm)) * 1e-3;
        Some((error_m, Vector3::from(seed.planned_axis)))
    };
    row.seeds.iter().filter_map(of_seed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use stylet_insertions::{Rest, Seed};

    /// Checks errors of known deviations, with a part common to all seeds of a needle.
    #[test]
    fn what_went_in_comes_out() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let (across_mm, along_mm, shared) = (2.0, 5.0, 0.6_f64);
        let mut table = Table::default();
        for _ in 0..4000 {
            let common = [normal(), normal(), normal()];
            let mut seed = || {
                let error = [0, 1, 2].map(|a| shared.sqrt() * common[a] + (1.0 - shared).sqrt() * normal());
                Seed {
                    planned_mm: [10.0, 20.0, 30.0],
                    planned_axis: [0.0, 0.0, 1.0],
                    strength_u: 0.5,
                    rest: Some(Rest {
                        at_mm: [
                            10.0 + across_mm * error[0] + 1.0,
                            20.0 + across_mm * error[1],
                            30.0 + along_mm * error[2] - 3.0,
                        ],
                        axis: [0.0, 0.0, 1.0],
                        dropped_after_s: 1.0,
                    }),
                }
            };
            let seeds = (0..4).map(|_| seed()).collect();
            table.rows.push(crate::tests::insertion_with(seeds));
        }
        let found = misplacement(&table).unwrap();
        let near =
            |found: f64, expected: f64| assert!((found - expected).abs() < 0.04 * expected.abs(), "{found} {expected}");
        near(found.sigma_m, across_mm * 1e-3);
        near(found.along_m.unwrap(), along_mm * 1e-3);
        near(found.within_strand, shared);
        near(found.shift_m[2], -3e-3);
        let quarter = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0);
        near(turned(found, &quarter).shift_m[0], -3e-3);
        table.rows.clear();
        assert_eq!(misplacement(&table), None);
    }
}
