//! The dose grid against the straightforward loop over the formulae.

use stylet_dose::decay::Interval;
use stylet_dose::isodose::isodose;
use stylet_dose::mesh::Mesh;
use stylet_dose::{DoseGrid, DoseKernel, DosePoints, Seed, Source};

fn kernel(name: &str) -> DoseKernel {
    let text = std::fs::read_to_string(stylet_test_kit::repository(&format!("sources/{name}.toml")));
    let source = Source::parse(&text.expect("a source of ours can be read"));
    DoseKernel::new(&source.expect("valid"), Interval::ALL)
}

/// Seeds off the voxel centres, each in another direction; every fifth without a direction.
fn seeds(count: usize) -> Vec<Seed> {
    (0..count)
        .map(|i| {
            let t = i as f64;
            let place = [
                0.035 + 0.018 * (1.7 * t).sin(),
                0.03 + 0.015 * (2.3 * t + 1.0).sin(),
                0.035 + 0.018 * (0.9 * t + 2.0).sin(),
            ];
            let (polar, round) = (0.3 * (1.1 * t).sin(), t);
            let axis = [polar.sin() * round.cos(), polar.sin() * round.sin(), polar.cos()];
            Seed {
                position_m: place,
                axis: (i % 5 != 4).then_some(axis),
                strength_u: 0.4 + 0.02 * (t * 0.7).sin(),
            }
        })
        .collect()
}

fn centres(grid: &DoseGrid) -> Vec<[f64; 3]> {
    let [nx, ny, nz] = grid.dims();
    (0..nx * ny * nz)
        .map(|i| grid.centre_m([i % nx, i / nx % ny, i / nx / ny]))
        .collect()
}

#[test]
fn any_grid_agrees_with_the_loop_over_seeds_and_voxels() {
    for name in ["i125_6711", "pd103_200"] {
        let (kernel, seeds) = (kernel(name), seeds(12));
        // The last grid has voxels beyond the table and within capsules.
        for (origin, spacing, dims) in [
            ([0.0; 3], [0.002, 0.002, 0.002], [36, 31, 36]),
            ([0.011, -0.003, 0.02], [0.0007, 0.0031, 0.005], [37, 1, 5]),
            ([-0.3, 0.03, 0.035], [0.0041, 0.001, 0.001], [150, 3, 2]),
            ([0.0345, 0.0295, 0.0345], [0.0001, 0.0001, 0.0001], [11, 12, 13]),
        ] {
            let mut grid = DoseGrid::new(origin, spacing, dims).expect("small");
            grid.add(&kernel, &seeds);
            let mut worst = 0.0_f64;
            for (at, found) in centres(&grid).into_iter().zip(grid.dose_gy()) {
                let expected: f64 = seeds.iter().map(|s| kernel.exact_at_gy(s, at)).sum();
                // Dose is quantised in steps of 2^-30 Gy per seed.
                worst = worst.max((found - expected).abs() / (expected + 1e-2));
            }
            println!("{name}, spacing {spacing:?}: worst {worst:.1e}");
            assert!(worst < 5e-4, "{name}: {worst:e}");
        }
    }
}

/// With angles that require columns of 2.5 degrees, and with one that requires columns of 1 degree.
#[test]
fn a_seed_whose_ends_differ_gives_each_side_its_own_dose() {
    for second_deg in [45.0, 37.0] {
        let text = format!(
            r#"
[source]
model = "tipped"
nuclide = "X-1"
half_life_days = 1
dose_rate_constant = 1
active_length_cm = 0.3
[radial]
r_cm = [0.1, 1, 10]
g_line = [1.1, 1, 0.1]
[anisotropy_2d]
r_cm = [1, 5]
theta_deg = [0, {second_deg}, 90, 140, 180]
F = [[0.3, 0.8, 1, 0.9, 0.6], [0.4, 0.9, 1, 0.7, 0.5]]
"#
        );
        let kernel = DoseKernel::new(&Source::parse(&text).expect("valid"), Interval::ALL);
        let mut grid = DoseGrid::covering([0.0; 3], [0.07, 0.06, 0.07], 0.003).expect("small");
        let seeds = seeds(2);
        grid.add(&kernel, &seeds);
        for (at, found) in centres(&grid).into_iter().zip(grid.dose_gy()) {
            let expected: f64 = seeds.iter().map(|s| kernel.exact_at_gy(s, at)).sum();
            assert!(
                (found - expected).abs() < 5e-4 * expected + 1e-8,
                "{at:?}: {found} {expected}"
            );
        }
    }
}

#[test]
fn seeds_in_any_order_and_seeds_taken_away_leave_the_same_bits() {
    let (kernel, seeds) = (kernel("i125_6711"), seeds(20));
    let mut grid = DoseGrid::covering([0.0; 3], [0.07, 0.06, 0.07], 0.002).expect("small");
    grid.add(&kernel, &seeds[..10]);
    let ten = grid.clone();
    grid.add(&kernel, &seeds[10..]);
    let twenty = grid.clone();
    grid.remove(&kernel, &seeds[10..15]);
    grid.remove(&kernel, &seeds[15..]);
    assert!(grid == ten, "something is left of a seed that was taken away");
    let mut other = DoseGrid::covering([0.0; 3], [0.07, 0.06, 0.07], 0.002).expect("small");
    for seed in seeds.iter().rev() {
        other.add(&kernel, std::slice::from_ref(seed));
    }
    assert!(other == twenty, "the order of the seeds matters");
}

#[test]
fn one_thread_and_many_give_the_same_bits() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        pool.install(|| {
            let (kernel, seeds) = (kernel("i125_6711"), seeds(9));
            let mut grid = DoseGrid::covering([0.0; 3], [0.07, 0.06, 0.07], 0.003).expect("small");
            grid.add(&kernel, &seeds);
            grid
        })
    };
    assert!(with(1) == with(5));
}

#[test]
fn points_and_grid_get_the_same_dose() {
    let (kernel, seeds) = (kernel("i125_6711"), seeds(7));
    let mut grid = DoseGrid::covering([0.0; 3], [0.07, 0.06, 0.07], 0.005).expect("small");
    grid.add(&kernel, &seeds);
    let mut points = DosePoints::new(&centres(&grid));
    points.add(&kernel, &seeds);
    for (a, b) in points.dose_gy().iter().zip(grid.dose_gy()) {
        assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
    }
    points.remove(&kernel, &seeds);
    assert!(points.dose_gy().iter().all(|&d| d == 0.0));
}

#[test]
fn between_voxels_a_linear_field_is_read_exactly_and_outside_it_is_held() {
    let mut grid = DoseGrid::new([0.01, 0.0, -0.02], [0.001, 0.002, 0.003], [5, 4, 3]).expect("small");
    let field = |p: [f64; 3]| 3.0 + 200.0 * p[0] - 50.0 * p[1] + 70.0 * p[2];
    grid.fill(field);
    for p in [[0.0123, 0.0041, -0.0172], [0.01, 0.0, -0.02], [0.014, 0.006, -0.014]] {
        assert!((grid.at_gy(p) - field(p)).abs() < 1e-12);
    }
    assert!((grid.at_gy([1.0, -1.0, 1.0]) - field([0.014, 0.0, -0.014])).abs() < 1e-12);
}

#[test]
fn grids_that_cannot_be_are_refused() {
    for (spacing, dims) in [
        ([0.0, 1.0, 1.0], [1, 1, 1]),
        ([f64::NAN, 1.0, 1.0], [1, 1, 1]),
        ([1.0; 3], [0, 1, 1]),
        ([1.0; 3], [usize::MAX, usize::MAX, 2]),
        ([1.0; 3], [1 << 14, 1 << 14, 2]),
    ] {
        assert!(DoseGrid::new([0.0; 3], spacing, dims).is_err(), "{spacing:?} {dims:?}");
    }
}

/// The isodose surfaces of a seed without a direction are spheres.
#[test]
fn the_isodose_of_one_seed_is_a_sphere_of_the_right_size() {
    let kernel = kernel("i125_6711");
    let seed = Seed {
        position_m: [0.0203, 0.0198, 0.0207],
        axis: None,
        strength_u: 0.5,
    };
    let mut grid = DoseGrid::covering([0.0; 3], [0.04; 3], 0.001).expect("small");
    grid.add(&kernel, &[seed]);
    for radius in [0.005, 0.01, 0.015] {
        let level = kernel.exact_at_gy(&seed, [0.0203 + radius, 0.0198, 0.0207]);
        let surface = isodose(&grid, level);
        let far = |p: &[f64; 3]| (0..3).map(|a| (p[a] - seed.position_m[a]).powi(2)).sum::<f64>().sqrt();
        let worst = surface
            .points_m
            .iter()
            .map(|p| (far(p) - radius).abs())
            .fold(0.0, f64::max);
        let mesh = Mesh::new(&surface.points_m, &surface.triangles).expect("closed");
        drop(mesh);
        let volume = volume(&surface.points_m, &surface.triangles);
        let expected = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        println!(
            "radius {} mm: off by {:.3} mm, volume {:+.2} %",
            radius * 1e3,
            worst * 1e3,
            (volume / expected - 1.0) * 100.0
        );
        // A net's points lie within the voxel that the surface crosses: the sagitta over a voxel, h²/(8 r), and as much
        // for its corners.
        assert!(worst < 0.12e-3, "off by {worst} m");
        assert!((volume / expected - 1.0).abs() < 0.03, "volume {volume} and {expected}");
        assert!(volume > 0.0, "the triangles are turned inside out");
    }
    assert!(isodose(&grid, 1e9).triangles.is_empty());
    let whole = isodose(&grid, 1e-9);
    Mesh::new(&whole.points_m, &whole.triangles).expect("closed along the faces of the grid");
}

fn volume(points: &[[f64; 3]], triangles: &[[usize; 3]]) -> f64 {
    let six = |t: &[usize; 3]| {
        let [a, b, c] = t.map(|i| points[i]);
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    triangles.iter().map(six).sum::<f64>() / 6.0
}
