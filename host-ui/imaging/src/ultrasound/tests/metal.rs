//! Place and brightness of needles and seeds, and the region behind them.

use super::{block, field, plane, scanner};
use crate::body::{NEEDLE_RADIUS_M, SEED_RADIUS_M};
use crate::ultrasound::beams::Grid;
use crate::ultrasound::marks::{RING_FALL, RING_M, SHADOW_DB};
use crate::ultrasound::{Plane, Scanner, Settings, View};
use crate::{Metal, Needle, Seed, Tissue};
use nalgebra::{Vector2, Vector3};

const FLAT: Settings = Settings {
    gain_db: 0.0,
    tgc_db_per_cm: 0.0,
    range_db: 60.0,
    texture_db: 0.0,
};

fn water() -> Scanner {
    let mut scanner = scanner();
    let body = block([Tissue::COUPLING; 3], |_| 1);
    scanner.set_body(&body, &field(|_| Vector3::zeros()));
    scanner
}

fn along(place_m: Vector3<f64>, axis: Vector3<f64>) -> Metal {
    Metal {
        needles: vec![Needle {
            points_m: vec![place_m + axis * 15e-3, place_m - axis * 15e-3],
        }],
        ..Metal::default()
    }
}

/// Returns the centroid of the brightness near a pixel.
fn middle_of_light(pixels: &[[u8; 4]], plane: &Plane, about: Vector2<f64>, within: f64) -> Vector2<f64> {
    let wide = plane.pixels[0] as usize;
    let mut sum = Vector2::zeros();
    let mut whole = 0.0;
    for (n, pixel) in pixels.iter().enumerate() {
        let at = Vector2::new((n % wide) as f64 + 0.5, (n / wide) as f64 + 0.5);
        if (at - about).amax() < within {
            // The echo itself, not its logarithm.
            let weight = 10_f64.powf(f64::from(pixel[0]) / 255.0 * 3.0) - 1.0;
            sum += at * weight;
            whole += weight;
        }
    }
    sum / whole
}

/// Checks a needle across each plane: it shows its wall, nearest to the probe, at the place by
/// trigonometry within a pixel.
#[test]
fn a_needle_is_imaged_in_place_to_a_pixel() {
    let mut scanner = water();
    let low_gain = Settings { gain_db: -20.0, ..FLAT };
    for view in View::ALL {
        let plane = plane(view);
        let [wide, high] = plane.pixels.map(f64::from);
        let (radius_m, depth_m) = (plane.probe.radius_m, plane.depth_m);
        for (across, r_m) in [(-0.6_f64, 30e-3), (0.0, 45e-3), (0.9, 38e-3), (0.3, 22e-3)] {
            let (place_m, expected) = match view {
                View::Transverse => {
                    let scale = (2.0 * (radius_m + depth_m) * 80_f64.to_radians().sin() / wide)
                        .max((radius_m + depth_m) / high);
                    let lowest_m = 0.5 * (radius_m + depth_m - high * scale);
                    let wall_m = r_m - NEEDLE_RADIUS_M;
                    // The patient's left, -x, is to the right.
                    let place_m = Vector3::new(-r_m * across.sin(), r_m * across.cos(), 0.0);
                    let x = 0.5 * wide + wall_m * across.sin() / scale;
                    (
                        place_m,
                        Vector2::new(x, high - (wall_m * across.cos() - lowest_m) / scale),
                    )
                }
                View::Sagittal => {
                    let scale = (65e-3 / wide).max((radius_m + depth_m) / high);
                    let lowest_m = 0.5 * (radius_m + depth_m - high * scale);
                    let z_m = 20e-3 * across;
                    let x = 0.5 * wide + z_m / scale;
                    let y = high - (r_m - NEEDLE_RADIUS_M - lowest_m) / scale;
                    (Vector3::new(0.0, r_m, z_m), Vector2::new(x, y))
                }
            };
            let axis = match view {
                View::Transverse => Vector3::z(),
                View::Sagittal => Vector3::x(),
            };
            scanner.picture(&plane, &low_gain, &along(place_m, axis));
            let found = middle_of_light(&scanner.pixels(), &plane, expected, 4.5);
            println!("{} {across}: {:.2} pixels off", view.name(), (found - expected).norm());
            assert!((found - expected).amax() < 1.0, "{found} against {expected}");
            let wall = place_m - place_m.with_z(view, r_m) * (NEEDLE_RADIUS_M / r_m);
            assert!(
                (plane.pixel_of(wall) - expected).norm() < 1e-6,
                "the crate's own mapping"
            );
            assert!((plane.pixel_of(plane.place_of(expected)) - expected).norm() < 1e-6);
        }
    }
}

/// Distance from the probe's axis along the beam.
trait AlongBeam {
    fn with_z(&self, view: View, r_m: f64) -> Vector3<f64>;
}

impl AlongBeam for Vector3<f64> {
    fn with_z(&self, view: View, r_m: f64) -> Vector3<f64> {
        match view {
            View::Transverse => *self,
            View::Sagittal => Vector3::new(0.0, r_m, 0.0),
        }
    }
}

fn peak_db(scanner: &mut Scanner, plane: &Plane, metal: &Metal) -> f64 {
    scanner.picture(plane, &FLAT, metal);
    let levels = scanner.levels_db();
    f64::from(levels.iter().copied().fold(f32::MIN, f32::max))
}

/// Checks that the echo outside the plane falls with the beam's profile, until nothing is visible.
#[test]
fn the_echo_outside_the_plane_falls_with_the_beam() {
    let mut scanner = water();
    let plane = plane(View::Sagittal);
    let r_m = 35e-3;
    let at = |x_m: f64| along(Vector3::new(x_m, r_m, 0.0), Vector3::z());
    let middle_db = peak_db(&mut scanner, &plane, &at(0.0));
    // 2 mm at half maximum where the lens has its focus, 25 mm deep.
    let spread_m = 2e-3 / 2.354_82;
    for off_plane_m in [0.3e-3, 0.8e-3, 1.5e-3, 2.5e-3_f64] {
        let expected_db = -4.342_94 * (off_plane_m / spread_m).powi(2);
        let found_db = peak_db(&mut scanner, &plane, &at(off_plane_m)) - middle_db;
        println!(
            "{:.1} mm: {found_db:.2} dB, {expected_db:.2} by the beam",
            off_plane_m * 1e3
        );
        assert!((found_db - expected_db).abs() < 0.3, "{found_db} against {expected_db}");
    }
    let far_db = peak_db(&mut scanner, &plane, &at(6e-3));
    assert!(far_db < -100.0, "{far_db}");
}

/// Checks reverberations behind the wall of a needle along the plane, each weaker than the last.
#[test]
fn a_needle_reverberates_behind_its_wall() {
    let mut scanner = water();
    let plane = plane(View::Sagittal);
    scanner.picture(&plane, &FLAT, &along(Vector3::new(0.0, 30e-3, 0.0), Vector3::z()));
    let grid = Grid::of(&plane);
    let levels = scanner.levels_db();
    let sample_m = plane.depth_m / f64::from(grid.samples - 1);
    let at = |depth_m: f64| {
        let near = (depth_m / sample_m).round() as usize;
        let beam = |k: usize| f64::from(levels[k * grid.lines as usize + grid.lines as usize / 2]);
        (near - 2..=near + 2).map(beam).fold(f64::MIN, f64::max)
    };
    let wall_m = 20e-3 - NEEDLE_RADIUS_M;
    let expected_db = 20.0 * RING_FALL.log10();
    // The first reverberation lies in the shadow of the wall as well.
    for ring in 2..5 {
        let fall_db = at(wall_m + RING_M * f64::from(ring)) - at(wall_m + RING_M * f64::from(ring - 1));
        assert!(
            (fall_db - expected_db).abs() < 0.5,
            "{ring}: {fall_db} against {expected_db}"
        );
    }
    let between_db = at(wall_m + 1.5 * RING_M) - at(wall_m + RING_M);
    println!("between rings {between_db:.1} dB");
}

/// Returns the mean level (dB) of a region, before it is compared with its neighbourhood.
fn mean_db(levels: &[f32], grid: Grid, samples: std::ops::Range<usize>, lines: std::ops::Range<usize>) -> f64 {
    let all: Vec<f64> = samples
        .flat_map(|k| lines.clone().map(move |l| k * grid.lines as usize + l))
        .map(|n| 10_f64.powf(f64::from(levels[n]) / 10.0))
        .collect();
    10.0 * (all.iter().sum::<f64>() / all.len() as f64).log10()
}

/// Compares the same speckle with and without an obstacle: the difference is the two-way loss.
#[test]
fn shadows_match_the_loss_and_the_width_of_the_obstacle() {
    let mut scanner = scanner();
    let plane = plane(View::Sagittal);
    let grid = Grid::of(&plane);
    let soft = Tissue::new(Tissue::SOFT.brightness, 0.5, 1.63);
    let levels = |scanner: &mut Scanner, slab: Tissue, metal: &Metal| {
        // 2 mm thick, 10 mm deep, under the superior half of the array.
        let body = block([soft, soft, slab], |p| {
            if p.z > 0.0 && (20e-3..22e-3).contains(&p.y) {
                2
            } else {
                1
            }
        });
        scanner.set_body(&body, &field(|_| Vector3::zeros()));
        scanner.picture(&plane, &FLAT, metal);
        scanner.levels_db()
    };
    let none = Metal::default();
    let clear = levels(&mut scanner, soft, &none);
    let line = |z_m: f64| ((z_m / plane.probe.half_length_m + 1.0) * 0.5 * f64::from(grid.lines - 1)) as usize;
    let (behind, shadow, beside) = (100..300, line(3e-3)..line(30e-3), line(-30e-3)..line(-3e-3));
    for (name, loss) in [("bone", 10.0), ("gas", 25.0)] {
        let dark = levels(&mut scanner, Tissue::new(Tissue::SOFT.brightness, loss, 1.63), &none);
        let expected_db = -2.0 * (f64::from(loss) - 0.5) * 7.0 * 0.2;
        let [found_db, beside_db] = [shadow.clone(), beside.clone()].map(|lines| {
            mean_db(&dark, grid, behind.clone(), lines.clone()) - mean_db(&clear, grid, behind.clone(), lines)
        });
        println!("{name}: {found_db:.2} dB, {expected_db:.2} by the loss; beside {beside_db:.3}");
        assert!(
            (found_db - expected_db).abs() < 0.3,
            "{name}: {found_db} against {expected_db}"
        );
        assert!(beside_db.abs() < 0.01, "{beside_db}");
    }
    let seed = Metal {
        seeds: vec![Seed {
            middle_m: Vector3::new(0.0, 25e-3, -10e-3),
            axis: Vector3::z(),
        }],
        ..Metal::default()
    };
    let dark = levels(&mut scanner, soft, &seed);
    // Clear of the wall and its reverberation, and of the ends of the seed by the spread of the
    // beam.
    let after = ((15e-3 - SEED_RADIUS_M + 3.0 * RING_M) / plane.depth_m * f64::from(grid.samples - 1)) as usize;
    let lines = line(-10.8e-3)..line(-9.2e-3);
    let found_db = mean_db(&dark, grid, after..300, lines.clone()) - mean_db(&clear, grid, after..300, lines);
    println!("seed: {found_db:.2} dB, {:.2} by its loss", -2.0 * SHADOW_DB);
    assert!((found_db + 2.0 * SHADOW_DB).abs() < 0.5, "{found_db}");
}

/// Checks that gain with depth that equals the loss leaves a picture as bright below as above.
#[test]
fn gain_with_depth_makes_up_for_the_loss() {
    let mut scanner = scanner();
    let plane = plane(View::Sagittal);
    let grid = Grid::of(&plane);
    scanner.set_body(&block([Tissue::SOFT; 3], |_| 1), &field(|_| Vector3::zeros()));
    for (tgc_db_per_cm, expected_db) in [(7.0, 0.0), (0.0, -28.0)] {
        let settings = Settings { tgc_db_per_cm, ..FLAT };
        scanner.picture(&plane, &settings, &Metal::default());
        let levels = scanner.levels_db();
        let step = 4e-2 / plane.depth_m * f64::from(grid.samples - 1);
        let mean = |from: usize| mean_db(&levels, grid, from..from + 60, 20..170);
        let found_db = mean(20 + step.round() as usize) - mean(20);
        println!("{tgc_db_per_cm} dB/cm: {found_db:.2} dB over 4 cm");
        assert!((found_db - expected_db).abs() < 0.7, "{found_db} against {expected_db}");
    }
}
