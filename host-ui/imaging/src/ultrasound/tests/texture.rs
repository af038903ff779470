//! Texture of soft tissue: strength, place, and attachment to the tissue.

use super::speckle::{between_scatterers, mean};
use super::{block, field, plane, scanner};
use crate::ultrasound::beams::Grid;
use crate::ultrasound::scanner::PATCH_M;
use crate::ultrasound::{Plane, Scanner, Settings, View};
use crate::{Metal, Tissue};
use nalgebra::Vector3;

const BOX_M: f64 = 3e-3;

fn of(tissue: Tissue) -> Scanner {
    let mut scanner = scanner();
    scanner.set_body(&block([tissue; 3], |_| 1), &field(|_| Vector3::zeros()));
    scanner
}

fn levels_db(scanner: &mut Scanner, plane: &Plane, texture_db: f64) -> Vec<f32> {
    let settings = Settings {
        texture_db,
        ..Settings::default()
    };
    scanner.picture(plane, &settings, &Metal::default()).expect("a picture");
    scanner.levels_db()
}

/// Returns the change of brightness by texture: the speckle is the same in both pictures.
fn brighter_db(scanner: &mut Scanner, plane: &Plane, texture_db: f64) -> Vec<f64> {
    let even = levels_db(scanner, plane, 0.0);
    let uneven = levels_db(scanner, plane, texture_db);
    uneven.iter().zip(&even).map(|(a, b)| f64::from(a - b)).collect()
}

/// Returns the mean in boxes of a sagittal picture, whose lower corners are given along the probe
/// and from it.
fn boxes_db(of_sample: &[f64], plane: &Plane, corners_m: impl Iterator<Item = [f64; 2]>) -> Vec<f64> {
    let grid = Grid::of(plane);
    let (lines, half_m) = (f64::from(grid.lines - 1), plane.probe.half_length_m);
    let line = |z_m: f64| ((z_m / half_m + 1.0) * 0.5 * lines).round() as usize;
    let sample = |depth_m: f64| (depth_m / plane.depth_m * f64::from(grid.samples - 1)).round() as usize;
    let of_box = |[z_m, depth_m]: [f64; 2]| {
        let rows = sample(depth_m)..sample(depth_m + BOX_M);
        mean(rows.flat_map(|k| {
            let row = &of_sample[k * grid.lines as usize..];
            row[line(z_m)..line(z_m + BOX_M)].iter().copied()
        }))
    };
    corners_m.map(of_box).collect()
}

/// Returns adjacent boxes, clear of the edges of the picture by the motion of the tissue in these
/// tests.
fn corners_m() -> impl Iterator<Item = [f64; 2]> {
    let place = |n: u32, first_m: f64| f64::from(n).mul_add(BOX_M, first_m);
    (0..17).flat_map(move |i| (0..15).map(move |j| [place(i, -27e-3), place(j, 6e-3)]))
}

fn spread(values: &[f64]) -> f64 {
    let middle = mean(values.iter().copied());
    mean(values.iter().map(|v| (v - middle).powi(2))).sqrt()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let [of_a, of_b] = [a, b].map(|v| mean(v.iter().copied()));
    let product = mean(a.iter().zip(b).map(|(a, b)| (a - of_a) * (b - of_b)));
    product / (spread(a) * spread(b))
}

/// Checks the spread of boxes: a mean over a box varies less than a point, by the correlation of
/// all pairs of points along each edge.
#[test]
fn boxes_of_tissue_differ_by_the_stated_spread() {
    const PLACES: u32 = 60;
    let texture_db = Settings::default().texture_db;
    let pairs = (0..PLACES).flat_map(|i| (0..PLACES).map(move |j| f64::from(i.abs_diff(j)) / f64::from(PLACES)));
    let edge = mean(pairs.map(|apart| between_scatterers(apart * BOX_M / PATCH_M)));
    let expected_db = texture_db * edge;
    let mut scanner = of(Tissue::SOFT);
    let mut all = Vec::new();
    for number in 0..6 {
        let mut plane = plane(View::Sagittal);
        plane.pose.middle_m.x += 7.1e-3 * f64::from(number) - 17e-3;
        let brighter = brighter_db(&mut scanner, &plane, texture_db);
        all.extend(boxes_db(&brighter, &plane, corners_m()));
    }
    let (found_db, middle_db) = (spread(&all), mean(all.iter().copied()));
    println!("boxes differ by {found_db:.2} dB, {expected_db:.2} by their size; mean {middle_db:.2} dB");
    // Neighbours among some 1,500 boxes are correlated, as if there were a third of them.
    let independent = all.len() as f64 / 3.0;
    assert!(
        (found_db / expected_db - 1.0).abs() < 3.0 / (2.0 * independent).sqrt(),
        "{found_db}"
    );
    assert!(middle_db.abs() < 3.0 * expected_db / independent.sqrt(), "{middle_db}");
}

/// Moves tissue out of the plane, away from the probe and along it.
#[test]
fn texture_follows_the_tissue() {
    let texture_db = Settings::default().texture_db;
    let moved_m = Vector3::new(4e-3, 5e-3, -3e-3);
    let mut scanner = of(Tissue::SOFT);
    let mut at = plane(View::Sagittal);
    let rest = boxes_db(&brighter_db(&mut scanner, &at, texture_db), &at, corners_m());
    scanner.set_field(&field(|_| moved_m));
    let in_place = boxes_db(&brighter_db(&mut scanner, &at, texture_db), &at, corners_m());
    at.pose.middle_m.x += moved_m.x;
    let along = corners_m().map(|[z_m, depth_m]| [z_m + moved_m.z, depth_m + moved_m.y]);
    let with = boxes_db(&brighter_db(&mut scanner, &at, texture_db), &at, along);
    let (with, without) = (correlation(&rest, &with), correlation(&rest, &in_place));
    println!("{with:.3} with the tissue, {without:.3} in place");
    assert!(with > 0.95 && without.abs() < 0.3, "{with}, in place {without}");
}

/// Checks that urine has no texture, and that a negligible texture changes nothing else.
#[test]
fn zero_texture_changes_no_bit_of_the_picture() {
    let urine = Tissue::new(0.02, Tissue::COUPLING.loss_db_per_cm_mhz, 1.52);
    // Not the gland's 0 dB, at which the smallest number counts.
    let soft = Tissue::new(0.50, Tissue::SOFT.loss_db_per_cm_mhz, 1.63);
    for view in View::ALL {
        let plane = plane(view);
        for (tissue, texture_db) in [(urine, 4.0), (soft, 1e-30)] {
            let mut scanner = of(tissue);
            let [without, with] = [0.0, texture_db].map(|db| levels_db(&mut scanner, &plane, db));
            let differ = without.iter().zip(&with).filter(|(a, b)| a.to_bits() != b.to_bits());
            assert_eq!(differ.count(), 0, "{tissue:?}, {texture_db} dB");
        }
    }
}
