//! Radiographs against other ray casters, in double precision.

use super::metal::{CORE_LENGTH_M, CORE_RADIUS_M, WALL_M, WELD_M};
use super::*;
use crate::body::{Body, NEEDLE_RADIUS_M, SEED_LENGTH_M, SEED_RADIUS_M};
use crate::xray::{BONE_PER_M, SILVER_PER_M, SOFT_PER_M, STEEL_PER_M, TITANIUM_PER_M};
use crate::{Needle, Seed, Tissue};
use nalgebra::{Matrix3, Vector2};
use stylet_shm_schema::GridInfo;

const SPACING_M: f64 = 1.36e-3;

/// Returns an ellipsoid of soft tissue with two rods of bone in it and a hole of gas.
fn body() -> Body {
    let dims = [50_u32, 44, 56];
    let grid = GridInfo {
        dims,
        reserved: 0,
        origin_m: [-34e-3, -30e-3, -38e-3],
        spacing_m: SPACING_M,
    };
    let place = |n: usize| {
        let [x, y, _] = dims.map(|d| d as usize);
        let at = Vector3::new(n % x, n / x % y, n / x / y);
        at.map(|c| c as f64 * SPACING_M) + Vector3::from(grid.origin_m)
    };
    let label = |p: Vector3<f64>| {
        let bone = |side: f64| (p.x - side * 12e-3 - 0.3 * p.z).hypot(p.y - 8e-3) < 5e-3;
        if p.component_div(&Vector3::new(32e-3, 28e-3, 36e-3)).norm() > 1.0 || p.x.hypot(p.y + 14e-3) < 6e-3 {
            0
        } else if bone(1.0) || bone(-1.0) {
            2
        } else {
            1
        }
    };
    let cells = (0..dims.iter().product::<u32>() as usize)
        .map(|n| label(place(n)))
        .collect();
    let mut tissues = [Tissue::COUPLING; 256];
    tissues[0].xray_per_m = 0.0;
    (tissues[1].xray_per_m, tissues[2].xray_per_m) = (SOFT_PER_M, BONE_PER_M);
    Body::new(grid, cells, tissues).expect("cells of the grid")
}

fn field(displacement: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Field {
    let info = GridInfo {
        dims: [10, 9, 11],
        reserved: 0,
        origin_m: [-36e-3, -32e-3, -40e-3],
        spacing_m: 8e-3,
    };
    let place = |n: usize| {
        let at = Vector3::new(n % 10, n / 10 % 9, n / 90);
        at.map(|c| c as f64 * info.spacing_m) + Vector3::from(info.origin_m)
    };
    let nodes: Vec<[f32; 3]> = (0..990)
        .map(|n| displacement(place(n)).map(|c| c as f32).into())
        .collect();
    Field::of(info, &nodes).expect("one for each node")
}

fn arm(orbital_deg: f64, cranial_deg: f64) -> CArm {
    CArm {
        pixels: [128, 128],
        detector_m: 0.13,
        orbital: orbital_deg.to_radians(),
        cranial: cranial_deg.to_radians(),
        ..CArm::about(Vector3::new(2e-3, -1e-3, 3e-3), Matrix3::identity())
    }
}

fn fluoroscope() -> Fluoroscope {
    Fluoroscope::new(Gpu::headless(true).expect("Mesa's software driver"))
}

fn per_m(body: &Body, at: Vector3<f64>) -> f64 {
    let cell = ((at - body.corner_m()) / SPACING_M).map(f64::floor);
    let dims = body.grid.dims.map(f64::from);
    if (0..3).any(|a| !(0.0..dims[a]).contains(&cell[a])) {
        return 0.0;
    }
    let [x, y, z] = [0, 1, 2].map(|a| cell[a] as usize);
    let [wide, high, _] = body.grid.dims.map(|d| d as usize);
    f64::from(body.tissues[usize::from(body.cells[(z * high + y) * wide + x])].xray_per_m)
}

/// Casts a ray by Siddon (1985): sorts every crossing with a plane between cells, and weights each
/// cell by the length between two crossings.
fn siddon(body: &Body, source: Vector3<f64>, end: Vector3<f64>) -> f64 {
    let way = end - source;
    let mut crossings = vec![0.0, 1.0];
    for axis in 0..3 {
        for plane in 0..=body.grid.dims[axis] {
            let at = body.corner_m()[axis] + f64::from(plane) * SPACING_M;
            let share = (at - source[axis]) / way[axis];
            if (0.0..1.0).contains(&share) {
                crossings.push(share);
            }
        }
    }
    crossings.sort_by(f64::total_cmp);
    let pieces = crossings.windows(2);
    let sum: f64 = pieces
        .map(|c| (c[1] - c[0]) * per_m(body, source + way * (0.5 * (c[0] + c[1]))))
        .sum();
    sum * way.norm()
}

/// Returns the largest and the root mean square difference in intensity, as a share of it, over
/// pixels with a stride.
fn compare(shown: &Radiograph, arm: &CArm, loss: impl Fn(Vector3<f64>, Vector3<f64>) -> f64) -> [f64; 2] {
    let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
    for row in (1..arm.pixels[1]).step_by(5) {
        for column in (2..arm.pixels[0]).step_by(5) {
            let expected = (-loss(arm.source_m(), arm.place_of(column, row))).exp();
            let found = f64::from(shown.transmission[(row * arm.pixels[0] + column) as usize]);
            let off = (found - expected) / expected;
            worst = worst.max(off.abs());
            squares += off * off;
            count += 1.0;
        }
    }
    [worst, (squares / count).sqrt()]
}

#[test]
fn the_body_at_rest_matches_siddon() {
    let (body, scope) = (body(), fluoroscope());
    let still = field(|_| Vector3::zeros());
    for (orbital, cranial) in [(0.0, 0.0), (30.0, 0.0), (-90.0, 0.0), (20.0, -25.0)] {
        let arm = arm(orbital, cranial);
        let shown = scope.shoot(&arm, &Attenuation::of_cells(&body), &still, &Metal::default());
        let [worst, rms] = compare(&shown, &arm, |source, end| siddon(&body, source, end));
        println!(
            "{orbital} {cranial}: worst {:.4} %, rms {:.4} %",
            worst * 100.0,
            rms * 100.0
        );
        assert!(worst < 0.01, "{worst}");
    }
}

/// Returns the place at rest of the tissue that is now at a place, by Newton's method from the
/// previous place.
fn newton(field: &Field, place: Vector3<f64>, start: Vector3<f64>) -> Vector3<f64> {
    const H_M: f64 = 1e-6;
    let mut rest = start;
    for _ in 0..8 {
        let miss = rest + field.displacement_m(rest) - place;
        if miss.norm() < 1e-10 {
            break;
        }
        let column = |axis: usize| {
            let mut step = Vector3::zeros();
            step[axis] = H_M;
            (field.displacement_m(rest + step) - field.displacement_m(rest - step)) / (2.0 * H_M)
        };
        let jacobian = Matrix3::identity() + Matrix3::from_columns(&[column(0), column(1), column(2)]);
        rest -= jacobian.lu().solve(&miss).expect("no folded tissue");
    }
    rest
}

#[test]
fn the_deformed_body_matches_fine_steps() {
    let (body, scope) = (body(), fluoroscope());
    let pushed = field(|p| {
        let near = (-(p - Vector3::new(5e-3, 0.0, 0.0)).norm_squared() / (2.0 * 16e-3_f64.powi(2))).exp();
        Vector3::new(1e-3 + 0.05 * p.y, 2e-3 * near, 8e-3 * near)
    });
    for (orbital, cranial) in [(0.0, 0.0), (55.0, 10.0)] {
        let arm = arm(orbital, cranial);
        let shown = scope.shoot(&arm, &Attenuation::of_cells(&body), &pushed, &Metal::default());
        let [worst, rms] = compare(&shown, &arm, |source, end| {
            const STEP_M: f64 = 0.05e-3;
            let along = (end - source).normalize();
            // 6 cm to both sides of the isocentre contain the body.
            let (first, last) = (0.65 - 0.06, 0.65 + 0.06);
            let count = ((last - first) / STEP_M) as usize;
            let mut rest = source + along * first;
            let mut sum = 0.0;
            for n in 0..count {
                let place = source + along * (first + (n as f64 + 0.5) * STEP_M);
                rest = newton(&pushed, place, rest);
                sum += per_m(&body, rest) * STEP_M;
            }
            sum
        });
        println!(
            "{orbital} {cranial}: worst {:.4} %, rms {:.4} %",
            worst * 100.0,
            rms * 100.0
        );
        assert!(worst < 0.01, "{worst}");
    }
}

/// Compares with fine steps through nested cylinders.
#[test]
fn metal_matches_fine_steps() {
    let axis = Vector3::new(0.3, -0.2, 0.9).normalize();
    let metal = Metal {
        seeds: vec![Seed {
            middle_m: Vector3::new(3e-3, 2e-3, -4e-3),
            axis,
        }],
        needles: vec![Needle {
            points_m: vec![Vector3::new(-6e-3, 1e-3, 2e-3), Vector3::new(-9e-3, 3e-3, -60e-3)],
        }],
    };
    let arm = CArm {
        pixels: [400, 400],
        detector_m: 0.04,
        ..arm(25.0, 10.0)
    };
    let losses = super::metal::losses(&arm, &metal);
    let seed = metal.seeds[0];
    let ends = &metal.needles[0].points_m;
    let at = |place: Vector3<f64>| {
        let from = place - seed.middle_m;
        let (along, beside) = (from.dot(&axis).abs(), from.cross(&axis).norm());
        let shaft = (ends[1] - ends[0]).normalize();
        let way = (place - ends[0]).dot(&shaft);
        let in_needle = (place - ends[0]).cross(&shaft).norm() < NEEDLE_RADIUS_M
            && (0.0..(ends[1] - ends[0]).norm()).contains(&way);
        let material = if beside < CORE_RADIUS_M && along < CORE_LENGTH_M / 2.0 {
            SILVER_PER_M
        } else if beside < SEED_RADIUS_M - WALL_M && along < SEED_LENGTH_M / 2.0 - WELD_M {
            0.0
        } else if beside < SEED_RADIUS_M && along < SEED_LENGTH_M / 2.0 {
            TITANIUM_PER_M
        } else if in_needle {
            STEEL_PER_M
        } else {
            return 0.0;
        };
        material - f64::from(SOFT_PER_M)
    };
    let [right, up] = arm.right_up();
    let (mut worst, mut seen) = (0.0_f64, 0);
    for (n, loss) in losses.iter().enumerate().step_by(7) {
        let middle = arm.place_of(n as u32 % 400, n as u32 / 400);
        let mut sum = 0.0;
        for ray in 0..9_i32 {
            let off = |n: i32| f64::from(n - 1) * arm.pixel_m() / 3.0;
            let end = middle + right * off(ray % 3) + up * off(ray / 3);
            let along = (end - arm.source_m()).normalize();
            const STEP_M: f64 = 4e-6;
            // All of the seed and the tip of the needle; beyond, nothing is compared.
            let loss: f64 = if *loss == 0.0 && n % 700 != 0 {
                0.0
            } else {
                (0..8000)
                    .map(|k| arm.source_m() + along * (0.65 - 0.016 + f64::from(k) * STEP_M))
                    .map(|place| at(place) * STEP_M)
                    .sum()
            };
            sum += (-loss).exp();
        }
        let expected = sum / 9.0;
        worst = worst.max((f64::from((-loss).exp()) - expected).abs());
        seen += usize::from(*loss != 0.0);
    }
    println!("{seen} pixels with metal, worst {:.3} %", worst * 100.0);
    assert!(seen > 200, "{seen}");
    assert!(worst < 0.01, "{worst}");
}

/// Compares with explicit trigonometry: a place is rotated into the arm's frame and projected
/// through a pinhole.
#[test]
fn seeds_are_projected_to_a_pixel() {
    let (body, scope) = (body(), fluoroscope());
    let still = field(|_| Vector3::zeros());
    for (orbital, cranial) in [(0.0, 0.0), (40.0, 0.0), (-35.0, 20.0)] {
        let arm = arm(orbital, cranial);
        for place in [Vector3::new(10e-3, 5e-3, -8e-3), Vector3::new(-13e-3, -6e-3, 15e-3)] {
            let metal = Metal {
                seeds: vec![Seed {
                    middle_m: place,
                    axis: Vector3::z(),
                }],
                ..Metal::default()
            };
            let clear = scope
                .shoot(&arm, &Attenuation::of_cells(&body), &still, &Metal::default())
                .clone();
            let dark = scope.shoot(&arm, &Attenuation::of_cells(&body), &still, &metal);
            let (mut sum, mut whole) = (Vector2::zeros(), 0.0);
            for (n, (before, after)) in clear.transmission.iter().zip(&dark.transmission).enumerate() {
                let weight = f64::from(before.ln() - after.ln());
                sum += Vector2::new((n % 128) as f64 + 0.5, (n / 128) as f64 + 0.5) * weight;
                whole += weight;
            }
            let found = sum / whole;
            let (a, b) = (arm.orbital, arm.cranial);
            let from = place - arm.isocentre_m;
            // Patient: x right, y anterior, z superior. About the long axis first, then towards the
            // head.
            let (left, forward) = (
                -from.x * a.cos() - from.y * a.sin(),
                -from.x * a.sin() + from.y * a.cos(),
            );
            let (deep, up) = (
                forward * b.cos() + from.z * b.sin(),
                from.z * b.cos() - forward * b.sin(),
            );
            let scale = 1.0 / (0.65 + deep) / (0.13 / 128.0);
            let expected = Vector2::new(64.0 + left * scale, 64.0 - up * scale);
            println!("{orbital} {cranial}: {:.3} pixels off", (found - expected).norm());
            assert!((found - expected).norm() < 1.0, "{found} against {expected}");
            assert!((arm.pixel_of(place) - expected).norm() < 1e-6);
        }
    }
}

#[test]
fn losses_are_those_of_the_tables_at_70_kev() {
    // Mass attenuation (cm²/g) at 60 and 80 keV, and density (g/cm³).
    let tables = [
        (f64::from(SOFT_PER_M), 0.2048_f64, 0.1823, 1.06),
        (f64::from(BONE_PER_M), 0.3148, 0.2229, 1.92),
        (STEEL_PER_M, 1.205, 0.5952, 7.874),
        (TITANIUM_PER_M, 0.7661, 0.4052, 4.54),
        (SILVER_PER_M, 5.766, 2.651, 10.5),
    ];
    let share = (70.0_f64 / 60.0).ln() / (80.0_f64 / 60.0).ln();
    for (constant, low, high, g_per_cm3) in tables {
        let per_m = low * (high / low).powf(share) * g_per_cm3 * 100.0;
        assert!((constant / per_m - 1.0).abs() < 1e-3, "{constant} {per_m}");
    }
}

/// Checks the dose: 80 kV at 1.016 m gives 49.8 uGy/mAs; at 0.5 m 0.4 mAs give 82 uGy.
#[test]
fn pulses_count_by_the_inverse_square_law() {
    let (arm, mut dose) = (arm(0.0, 0.0), DoseCounter::default());
    for _ in 0..3 {
        dose.count(&Exposure::default(), &arm);
    }
    let expected = 3.0 * 8.373e-9 * 80_f64.powf(1.983) * 0.4 * (1.016_f64 / 0.5).powi(2);
    assert_eq!(dose.pulses, 3);
    assert!((dose.air_kerma_gy / expected - 1.0).abs() < 1e-12);
    assert!((dose.air_kerma_gy / 3.0 - 82e-6).abs() < 1e-6, "{}", dose.air_kerma_gy);
    // The field is as wide as the detector, scaled by the distance, and the product is equal at any
    // distance.
    let edge_m = arm.detector_m * 0.5 / 1.0;
    assert!((dose.kerma_area_gy_m2 / (expected * edge_m * edge_m) - 1.0).abs() < 1e-12);
    let far = CArm {
        source_to_isocentre_m: 0.9,
        ..arm
    };
    let [near, far] = [arm, far].map(|arm| Exposure::FLUOROSCOPY.kerma_area_gy_m2(&arm));
    assert!((near / far - 1.0).abs() < 1e-12);
    assert!((dose.beam_s - 0.024).abs() < 1e-12);
}

#[test]
#[ignore = "a measurement, not a claim: cargo test --profile quick -p stylet-imaging pulses_a_second -- --ignored --nocapture"]
fn pulses_a_second() {
    let (body, scope) = (body(), fluoroscope());
    let moved = field(|p| Vector3::new(0.0, 0.1 * p.x, 1e-3));
    let arm = CArm {
        pixels: [512, 512],
        detector_m: 0.21,
        ..arm(20.0, 10.0)
    };
    let seeds = (0..60).map(|n| Seed {
        middle_m: Vector3::new(f64::from(n % 8) - 4.0, f64::from(n / 8) - 4.0, 0.0) * 4e-3,
        axis: Vector3::z(),
    });
    let metal = Metal {
        seeds: seeds.collect(),
        ..Metal::default()
    };
    let mut times: Vec<f64> = (0..20)
        .map(|_| {
            let start = std::time::Instant::now();
            scope.shoot(&arm, &Attenuation::of_cells(&body), &moved, &metal).greys();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!(
        "radiograph of 512 x 512: p50 {:.1} ms, most {:.1} ms",
        times[10], times[19]
    );
}
