use super::*;
use crate::decay::Interval;
use crate::{DoseKernel, DosePoints, Source};

const AXIS: [f64; 3] = [0.6, 0.0, 0.8];

fn seed() -> Seed {
    Seed {
        position_m: [0.01, 0.02, 0.03],
        axis: Some(AXIS),
        strength_u: 0.5,
    }
}

fn offsets(errors: Errors, count: usize, strands: &[usize], trial: usize) -> Vec<[f64; 3]> {
    let seed = seed();
    let moved = errors.apply(&vec![seed; count], strands, 7, trial);
    assert!(
        moved
            .iter()
            .all(|m| m.axis == seed.axis && m.strength_u == seed.strength_u)
    );
    let off = |m: &Seed| [0, 1, 2].map(|a| m.position_m[a] - seed.position_m[a]);
    moved.iter().map(off).collect()
}

fn sigma(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn moves_have_the_requested_deviation_along_each_axis() {
    let off = offsets(Errors::of_sigma(4e-3), 20_000, &[], 3);
    for a in 0..3 {
        let along: Vec<f64> = off.iter().map(|o| o[a]).collect();
        let mean = along.iter().sum::<f64>() / along.len() as f64;
        // Four standard errors.
        assert!(mean.abs() < 4.0 * 4e-3 / 141.0, "mean {mean}");
        assert!(
            (sigma(&along) / 4e-3 - 1.0).abs() < 4.0 / 200.0,
            "sigma {}",
            sigma(&along)
        );
    }
    assert_ne!(off[0], offsets(Errors::of_sigma(4e-3), 1, &[], 4)[0]);
}

#[test]
fn errors_along_and_across_have_separate_deviations() {
    let errors = Errors {
        along_m: Some(6e-3),
        ..Errors::of_sigma(2e-3)
    };
    let off = offsets(errors, 20_000, &[], 0);
    let along = |axis: [f64; 3]| -> Vec<f64> { off.iter().map(|o| (0..3).map(|a| o[a] * axis[a]).sum()).collect() };
    for (axis, expected) in [(AXIS, 6e-3), ([0.8, 0.0, -0.6], 2e-3), ([0.0, 1.0, 0.0], 2e-3)] {
        let found = sigma(&along(axis));
        assert!((found / expected - 1.0).abs() < 4.0 / 200.0, "{axis:?} {found}");
    }
}

/// Checks full correlation, which is one draw for each strand, and half, which is a correlation of
/// 0.5 at an unchanged deviation.
#[test]
fn seeds_of_one_strand_share_their_correlated_errors() {
    let of = |within_strand: f64| Errors {
        within_strand,
        ..Errors::of_sigma(4e-3)
    };
    let strands: Vec<usize> = (0..20_000).map(|i| i / 2).collect();
    let off = offsets(of(1.0), 20_000, &strands, 0);
    let near = |p: [f64; 3], q: [f64; 3]| (0..3).all(|a| (p[a] - q[a]).abs() < 1e-15);
    assert!(off.chunks(2).all(|pair| near(pair[0], pair[1])));
    assert!(off.windows(2).skip(1).step_by(2).all(|pair| !near(pair[0], pair[1])));
    let off = offsets(of(0.5), 20_000, &strands, 0);
    let products = off
        .chunks(2)
        .flat_map(|pair| [0, 1, 2].map(|a| pair[0][a] * pair[1][a]));
    let correlation = products.sum::<f64>() / 30_000.0 / 4e-3_f64.powi(2);
    // Its standard error is sqrt((1 + 0.25) / 30,000) = 0.0065.
    assert!((correlation - 0.5).abs() < 0.026, "{correlation}");
    let all: Vec<f64> = off.iter().flatten().copied().collect();
    assert!((sigma(&all) / 4e-3 - 1.0).abs() < 0.02, "{}", sigma(&all));
}

/// Checks a shift without any other error: it gives the dose of the plan at points shifted the
/// other way.
#[test]
fn a_pure_shift_gives_the_dose_of_shifted_seeds() {
    let source = Source::known("6711").unwrap();
    let kernel = DoseKernel::new(&source, Interval::ALL);
    let shift_m = [2e-3, -1e-3, 3e-3];
    let errors = Errors {
        shift_m,
        ..Errors::of_sigma(0.0)
    };
    let plan = [
        seed(),
        Seed {
            position_m: [0.015, 0.01, 0.02],
            ..seed()
        },
    ];
    let points: Vec<[f64; 3]> = vec![[0.02, 0.02, 0.025], [0.0, 0.03, 0.035], [0.012, 0.012, 0.04]];
    let back: Vec<[f64; 3]> = points.iter().map(|p| [0, 1, 2].map(|a| p[a] - shift_m[a])).collect();
    let found = DosePoints::new(&points).of_seeds_gy(&kernel, &errors.apply(&plan, &[], 1, 9));
    let expected = DosePoints::new(&back).of_seeds_gy(&kernel, &plan);
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
    }
}

#[test]
fn a_random_shift_is_drawn_once_per_trial() {
    let errors = Errors {
        shift_sigma_m: 3e-3,
        ..Errors::of_sigma(0.0)
    };
    let of_trials: Vec<[f64; 3]> = (0..4000)
        .map(|trial| {
            let off = offsets(errors, 3, &[], trial);
            assert!(off.iter().all(|o| *o == off[0]));
            off[0]
        })
        .collect();
    let all: Vec<f64> = of_trials.iter().flatten().copied().collect();
    assert!((sigma(&all) / 3e-3 - 1.0).abs() < 4.0 / 154.0, "{}", sigma(&all));
}

/// Checks that the number of remaining seeds is binomial: mean n (1 - p), variance n p (1 - p).
#[test]
fn lost_seeds_are_binomial_and_do_not_move_the_others() {
    let (count, p, trials) = (100_usize, 0.05, 4000_usize);
    let errors = Errors {
        loss: p,
        ..Errors::of_sigma(1e-3)
    };
    let left: Vec<f64> = (0..trials)
        .map(|t| offsets(errors, count, &[], t).len() as f64)
        .collect();
    let mean = left.iter().sum::<f64>() / trials as f64;
    let variance = left.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / trials as f64;
    let expected = count as f64 * p * (1.0 - p);
    // Four standard errors.
    assert!((mean - 95.0).abs() < 4.0 * (expected / trials as f64).sqrt(), "{mean}");
    assert!(
        (variance / expected - 1.0).abs() < 4.0 * (2.0 / trials as f64).sqrt(),
        "{variance}"
    );
    let whole = offsets(Errors::of_sigma(1e-3), count, &[], 0);
    assert!(offsets(errors, count, &[], 0).iter().all(|o| whole.contains(o)));
    let none = Errors { loss: 1.0, ..errors };
    assert!(offsets(none, count, &[], 0).is_empty());
}
