//! Statistics of speckle, and its attachment to the tissue.

use super::{block, field, plane, scanner};
use crate::ultrasound::beams::Grid;
use crate::ultrasound::{Plane, Scanner, Settings, View};
use crate::{Metal, Tissue};
use nalgebra::Vector3;
use std::ops::Range;

const SCATTERING: Tissue = Tissue::new(Tissue::SOFT.brightness, 0.0, 1.63);
const FLAT: Settings = Settings {
    gain_db: 0.0,
    tgc_db_per_cm: 0.0,
    range_db: 60.0,
    texture_db: 0.0,
};

fn scattering() -> Scanner {
    let mut scanner = scanner();
    let body = block([SCATTERING; 3], |_| 1);
    scanner.set_body(&body, &field(|_| Vector3::zeros()));
    scanner
}

/// Returns intensities by sample and beam.
fn intensities(scanner: &mut Scanner, plane: &Plane) -> Vec<Vec<f64>> {
    scanner.picture(plane, &FLAT, &Metal::default()).expect("a picture");
    let lines = Grid::of(plane).lines as usize;
    let levels = scanner.levels_db();
    let rows = levels.chunks_exact(lines);
    rows.map(|row| row.iter().map(|db| 10_f64.powf(f64::from(*db) / 10.0)).collect())
        .collect()
}

pub(super) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    sum / count
}

/// Returns the correlation of the same places in two pictures, the second shifted by samples and
/// beams.
fn correlation(one: &[Vec<f64>], other: &[Vec<f64>], [down, right]: [usize; 2], samples: Range<usize>) -> f64 {
    let lines = 20..one[0].len() - 20 - right;
    let pairs: Vec<(f64, f64)> = samples
        .flat_map(|k| lines.clone().map(move |l| (k, l)))
        .map(|(k, l)| (one[k][l], other[k + down][l + right]))
        .collect();
    let (a, b) = (mean(pairs.iter().map(|p| p.0)), mean(pairs.iter().map(|p| p.1)));
    let product = mean(pairs.iter().map(|p| (p.0 - a) * (p.1 - b)));
    let squares = mean(pairs.iter().map(|p| (p.0 - a).powi(2))) * mean(pairs.iter().map(|p| (p.1 - b).powi(2)));
    product / squares.sqrt()
}

/// Checks independent places in planes 6.1 mm apart, which lie differently among the scatterers.
/// Mean over deviation is 1.913, and the distribution is Rayleigh's by Kolmogorov and Smirnov.
#[test]
fn many_scatterers_give_rayleigh_speckle() {
    let mut scanner = scattering();
    for view in View::ALL {
        // Separation in samples and beams. Number of places that count as one, since the power of a
        // plane varies by up to 15 % with its position among the scatterers.
        let (apart, alike) = match view {
            View::Transverse => ([8, 14], 4.0),
            View::Sagittal => ([8, 8], 3.0),
        };
        let mut amplitudes = Vec::new();
        for number in 0..6 {
            let mut plane = plane(view);
            let by_m = 6.1e-3 * f64::from(number) - 15e-3;
            match view {
                View::Transverse => plane.pose.middle_m.z += by_m,
                View::Sagittal => plane.pose.middle_m.x += by_m,
            }
            let all = intensities(&mut scanner, &plane);
            let lines = 20..all[0].len() - 20;
            for row in all[40..300].iter().step_by(apart[0]) {
                amplitudes.extend(row[lines.clone()].iter().step_by(apart[1]).map(|i| i.sqrt()));
            }
        }
        let count = amplitudes.len() as f64;
        let independent = count / alike;
        let level = mean(amplitudes.iter().copied());
        let power = mean(amplitudes.iter().map(|a| a * a));
        let ratio = level / (power - level * level).sqrt();
        // Standard error by the moments of the distribution: 1.36 over the root of the number of
        // independent places.
        let error = 1.36 / independent.sqrt();
        amplitudes.sort_by(f64::total_cmp);
        let farthest = amplitudes
            .iter()
            .enumerate()
            .map(|(n, a)| (1.0 - (-a * a / power).exp() - (n as f64 + 0.5) / count).abs())
            .fold(0.0, f64::max);
        // At 5 % with the power estimated from the same values (Lilliefors, exponential).
        let limit = 1.094 / independent.sqrt();
        println!(
            "{}: {count} places, {independent} of them independent, SNR {ratio:.4} +- {error:.4}, KS {farthest:.4} of {limit:.4}, power {power:.4}",
            view.name()
        );
        assert!((ratio - 1.9131).abs() < 3.0 * error, "{ratio} +- {error}");
        assert!(farthest < limit, "{farthest} over {limit}");
        // The standard error of the mean of an exponential distribution.
        let of_power = 3.0 / independent.sqrt();
        assert!((power - 1.0).abs() < of_power, "the gland's mean is 0 dB: {power}");
    }
}

/// Returns the correlation of points separated by a share of the distance between scatterers,
/// linearly interpolated with equal power: an integral over their position.
pub(super) fn between_scatterers(apart: f64) -> f64 {
    let at = |place: f64, node: f64| (1.0 - (place - node).abs()).max(0.0);
    let power = |place: f64| (-1..6).map(|n| at(place, f64::from(n)).powi(2)).sum::<f64>();
    let places = (0..200).map(|n| (f64::from(n) + 0.5) / 200.0);
    let both = places.map(|x| {
        let sum: f64 = (-1..6).map(|n| at(x, f64::from(n)) * at(x + apart, f64::from(n))).sum();
        sum / (power(x) * power(x + apart)).sqrt()
    });
    both.sum::<f64>() / 200.0
}

/// Checks that intensities are correlated like the square of amplitudes: by the overlap of a
/// Gaussian with itself, and by common scatterers.
#[test]
fn speckle_is_as_wide_as_the_point_spread() {
    let mut scanner = scattering();
    let plane = plane(View::Sagittal);
    let all = intensities(&mut scanner, &plane);
    let grid = Grid::of(&plane);
    let step_m = [
        plane.depth_m / f64::from(grid.samples - 1),
        2.0 * plane.probe.half_length_m / f64::from(grid.lines - 1),
    ];
    let rows = [100..140, 240..280];
    for rows in rows {
        let depth_m = 0.5 * (rows.start + rows.end) as f64 * step_m[0];
        let spreads = [plane.probe.axial_m, plane.probe.lateral_at_m(depth_m)];
        let scatterers_m = [grid.scatterers_m[1], grid.scatterers_m[2]];
        for axis in 0..2 {
            let amplitude = |lag: f64| -> f64 {
                let overlap = |by: f64| (-0.25 * (by * step_m[axis] / spreads[axis]).powi(2)).exp();
                (-20..=20)
                    .map(f64::from)
                    .filter(|by| (lag + by).abs() * step_m[axis] < 3.0 * scatterers_m[axis])
                    .map(|by| overlap(by) * between_scatterers((lag + by).abs() * step_m[axis] / scatterers_m[axis]))
                    .sum()
            };
            for lag in 1..4_usize {
                let way_m = lag as f64 * step_m[axis];
                let expected = (amplitude(lag as f64) / amplitude(0.0)).powi(2);
                let moved = if axis == 0 { [lag, 0] } else { [0, lag] };
                let found = correlation(&all, &all, moved, rows.clone());
                println!(
                    "depth {:.0} mm, axis {axis}, {:.2} mm: {found:.3}, by the point spread {expected:.3}",
                    depth_m * 1e3,
                    way_m * 1e3
                );
                assert!((found - expected).abs() < 0.06, "{found} against {expected}");
            }
        }
    }
}

/// Checks that moving tissue takes its speckle with it: by two samples in depth, by two beams along
/// the probe, and between beams.
#[test]
fn speckle_follows_the_tissue() {
    let mut scanner = scattering();
    for (view, least) in [(View::Sagittal, 0.95), (View::Transverse, 0.9)] {
        let plane = plane(view);
        let grid = Grid::of(&plane);
        let sample_m = plane.depth_m / f64::from(grid.samples - 1);
        scanner.set_field(&field(|_| Vector3::zeros()));
        let rest = intensities(&mut scanner, &plane);
        scanner.set_field(&field(|_| Vector3::new(0.0, 2.0 * sample_m, 0.0)));
        let moved = intensities(&mut scanner, &plane);
        // In a sector only the middle beams run along y.
        let middle = |all: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let half = if view == View::Sagittal { 96 } else { 30 };
            let lines = grid.lines as usize / 2;
            all.iter().map(|row| row[lines - half..lines + half].to_vec()).collect()
        };
        let (rest, moved) = (middle(&rest), middle(&moved));
        let with = correlation(&rest, &moved, [2, 0], 40..280);
        let without = correlation(&rest, &moved, [0, 0], 40..280);
        println!("{}: {with:.3} with the tissue, {without:.3} in place", view.name());
        assert!(with > least && without < 0.8 * with, "{with}, in place {without}");
    }
    let plane = plane(View::Sagittal);
    let pitch_m = 2.0 * plane.probe.half_length_m / f64::from(Grid::of(&plane).lines - 1);
    scanner.set_field(&field(|_| Vector3::zeros()));
    let rest = intensities(&mut scanner, &plane);
    scanner.set_field(&field(|_| Vector3::new(0.0, 0.0, 2.0 * pitch_m)));
    let moved = intensities(&mut scanner, &plane);
    let with = correlation(&rest, &moved, [0, 2], 40..280);
    println!("along the probe: {with:.3}");
    assert!(with > 0.95, "{with}");
}

/// Guards against scatterers from a periodic cube, which repeated the picture 32 mm to the right
/// (correlation 1.00).
#[test]
fn no_grain_is_seen_again_elsewhere() {
    let mut scanner = scattering();
    for view in View::ALL {
        let at = |scanner: &mut Scanner, [x, y, z]: [f64; 3]| {
            let mut plane = plane(view);
            plane.pose.middle_m += Vector3::new(x, y, z) * 1e-3;
            intensities(scanner, &plane)
        };
        let here = at(&mut scanner, [-19.2, -8.0, 0.0]);
        let mut most = 0.0_f64;
        for by in [
            [8.0, 0.0, 0.0],
            [32.0, 0.0, 0.0],
            [38.4, 0.0, 0.0],
            [0.0, 8.0, 0.0],
            [32.0, 8.0, 0.0],
            [0.0, 0.0, 11.2],
            [0.0, 0.0, 28.8],
            [13.25, 0.0, 0.0],
            [9.25, 17.75, 28.8],
        ] {
            let there = at(&mut scanner, [by[0] - 19.2, by[1] - 8.0, by[2]]);
            let alike = correlation(&here, &there, [0, 0], 40..250);
            most = most.max(alike.abs());
            println!("{} {by:?} mm: {alike:.3}", view.name());
        }
        // Some 1,600 independent places: four standard errors.
        assert!(most < 0.1, "{view:?}: {most}");
    }
}
