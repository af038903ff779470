//! Dose-volume histograms against closed forms: spheres and cylinders in fields that can be integrated by hand.

use nalgebra::{Rotation3, Vector3};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use stylet_dose::mesh::Mesh;
use stylet_dose::metric::Value;
use stylet_dose::{DoseGrid, Dvh, Metric, Region, Structure};
use stylet_files::{VoxelFrame, Voxels};
use stylet_implant::readers::labels::structures;

const GRID_M: f64 = 1e-3;
const MIDDLE: [f64; 3] = [0.0303, 0.0288, 0.0316];

struct Sphere {
    radius_m: f64,
}

/// A cylinder along z, about its centre.
struct Cylinder {
    radius_m: f64,
    length_m: f64,
}

fn from_middle(p: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|a| p[a] - MIDDLE[a])
}

fn around(half: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    (
        [0, 1, 2].map(|a| MIDDLE[a] - half[a]),
        [0, 1, 2].map(|a| MIDDLE[a] + half[a]),
    )
}

impl Region for Sphere {
    fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        around([self.radius_m; 3])
    }

    fn contains(&self, p: [f64; 3]) -> bool {
        from_middle(p).iter().map(|d| d * d).sum::<f64>() <= self.radius_m.powi(2)
    }
}

impl Region for Cylinder {
    fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        around([self.radius_m, self.radius_m, self.length_m / 2.0])
    }

    fn contains(&self, p: [f64; 3]) -> bool {
        let [x, y, z] = from_middle(p);
        x.hypot(y) <= self.radius_m && z.abs() <= self.length_m / 2.0
    }
}

/// Samples the field on a grid of 1 mm, like a computed dose.
fn dvh(structure: &Structure, field_gy: impl Fn([f64; 3]) -> f64 + Sync) -> Dvh {
    let mut grid = DoseGrid::covering([0.0; 3], [0.062; 3], GRID_M).expect("small");
    grid.fill(|p| field_gy(from_middle(p)));
    let dose: Vec<f64> = structure.points_m.iter().map(|&p| grid.at_gy(p)).collect();
    Dvh::new(&dose, &structure.volumes_m3).expect("there are points")
}

/// Fine enough for some ten thousand cells in a structure.
fn pitch_m(volume_m3: f64) -> f64 {
    (volume_m3 / 2e5).cbrt().min(0.5e-3)
}

/// Largest difference from the closed form over the whole curve, as a fraction of the structure.
fn worst(dvh: &Dvh, volume_m3: f64, from_gy: f64, to_gy: f64, closed_m3: impl Fn(f64) -> f64) -> f64 {
    (0..=200)
        .map(|i| from_gy + (to_gy - from_gy) * f64::from(i) / 200.0)
        .map(|gy| (dvh.at_least_m3(gy) - closed_m3(gy)).abs() / volume_m3)
        .fold(0.0, f64::max)
}

#[test]
fn spheres_in_fields_that_rise_along_a_line_or_to_the_middle() {
    for radius_m in [0.02_f64, 0.005, 0.002] {
        let volume = 4.0 / 3.0 * PI * radius_m.powi(3);
        let sphere = Structure::of_region("sphere", &Sphere { radius_m }, pitch_m(volume));
        let off = (sphere.volume_m3() / volume - 1.0).abs();
        // The part above a plane at height t.
        let cap = |t: f64| {
            let t = t.clamp(-radius_m, radius_m);
            PI * (radius_m - t).powi(2) * (2.0 * radius_m + t) / 3.0
        };
        let mut errors = vec![off];
        for direction in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.6, 0.64, 0.48]] {
            let slope = 2000.0;
            let along = |d: [f64; 3]| (0..3).map(|a| d[a] * direction[a]).sum::<f64>();
            let curve = dvh(&sphere, |d| 145.0 + slope * along(d));
            let (low, high) = (145.0 - slope * radius_m, 145.0 + slope * radius_m);
            errors.push(worst(&curve, volume, low, high, |gy| cap((gy - 145.0) / slope)));
        }
        // 145 Gy in the centre, and half of it at the surface.
        let fall = |r2: f64| 145.0 * (-(2.0_f64.ln()) * r2 / radius_m.powi(2)).exp();
        let curve = dvh(&sphere, |d| fall(d.iter().map(|c| c * c).sum()));
        let inside = |gy: f64| {
            let r2 = (-(gy / 145.0).log2()).clamp(0.0, 1.0) * radius_m.powi(2);
            4.0 / 3.0 * PI * r2.powf(1.5)
        };
        let radial = worst(&curve, volume, 72.5, 145.0, inside);
        println!(
            "sphere of {} mm: volume and linear fields {errors:.5?}, radial field {radial:.5}",
            radius_m * 1e3
        );
        assert!(errors.iter().all(|&e| e < 1e-3), "{errors:?}");
        // The field itself at the points, as for a plan's dose; a grid of 1 mm is too coarse for a dose that halves
        // within 2 mm.
        let dose: Vec<f64> = sphere
            .points_m
            .iter()
            .map(|&p| fall(from_middle(p).iter().map(|c| c * c).sum()))
            .collect();
        let direct = Dvh::new(&dose, &sphere.volumes_m3).expect("there are points");
        let direct = worst(&direct, volume, 72.5, 145.0, inside);
        println!("  without the grid {direct:.5}");
        assert!(direct < 1e-3, "{direct}");
        assert!(radial < if radius_m > 4e-3 { 1e-3 } else { 2e-2 }, "{radial}");
    }
}

#[test]
fn cylinders_in_fields_along_across_and_around() {
    for (radius_m, length_m) in [(0.012, 0.04), (0.003, 0.03)] {
        let volume = PI * radius_m * radius_m * length_m;
        let cylinder = Structure::of_region("cylinder", &Cylinder { radius_m, length_m }, pitch_m(volume));
        let off = (cylinder.volume_m3() / volume - 1.0).abs();
        let slope = 2000.0;
        let along = dvh(&cylinder, |d| 145.0 + slope * d[2]);
        let reach = slope * length_m / 2.0;
        let along = worst(&along, volume, 145.0 - reach, 145.0 + reach, |gy| {
            volume * (0.5 - (gy - 145.0) / slope / length_m)
        });
        let across = dvh(&cylinder, |d| 145.0 + slope * d[0]);
        let reach = slope * radius_m;
        let across = worst(&across, volume, 145.0 - reach, 145.0 + reach, |gy| {
            let t = ((gy - 145.0) / slope / radius_m).clamp(-1.0, 1.0);
            radius_m * radius_m * (t.acos() - t * (1.0 - t * t).sqrt()) * length_m
        });
        // As near a long source 20 mm thick: 1 / (rho² + (20 mm)²).
        let core = 0.02_f64.powi(2);
        let around = dvh(&cylinder, |d| 145.0 * core / (d[0] * d[0] + d[1] * d[1] + core));
        let edge = 145.0 * core / (radius_m * radius_m + core);
        let around = worst(&around, volume, edge, 145.0, |gy| {
            PI * (145.0 * core / gy - core) * length_m
        });
        println!(
            "cylinder of {} mm: volume {off:.5}, along {along:.5}, across {across:.5}, around {around:.5}",
            radius_m * 1e3
        );
        for error in [off, along, across] {
            assert!(error < 1e-3, "{error}");
        }
        assert!(around < if radius_m > 4e-3 { 1e-3 } else { 2e-2 }, "{around}");
    }
}

#[test]
fn doses_to_volumes_follow_the_closed_form_and_d01cc_is_not_d2cc() {
    let radius_m = 0.015_f64;
    let volume = 4.0 / 3.0 * PI * radius_m.powi(3);
    let sphere = Structure::of_region("sphere", &Sphere { radius_m }, pitch_m(volume));
    let core = 0.02_f64.powi(2);
    let curve = dvh(&sphere, |d| {
        200.0 * core / (d.iter().map(|c| c * c).sum::<f64>() + core)
    });
    let expected = |m3: f64| 200.0 * core / ((3.0 * m3 / 4.0 / PI).powf(2.0 / 3.0) + core);
    let dose = |name: &str| match Metric::parse(name).expect("a metric").of(&curve, 145.0) {
        Value::Dose { gy, percent } => {
            assert!((percent - gy / 1.45).abs() < 1e-9);
            gy
        }
        other => panic!("{name} is {other:?}"),
    };
    for (name, m3) in [
        ("D0.1cc", 0.1e-6),
        ("D2cc", 2e-6),
        ("D90", 0.9 * volume),
        ("D10", 0.1 * volume),
        ("D30", 0.3 * volume),
    ] {
        let off = dose(name) / expected(m3) - 1.0;
        println!("{name}: {:.3} Gy, off by {off:+.5}", dose(name));
        assert!(off.abs() < 1e-3, "{name}: {} and {}", dose(name), expected(m3));
    }
    assert!(dose("D0.1cc") > 1.1 * dose("D2cc"));
    let small = Metric::parse("D20cc").expect("a metric").of(&curve, 145.0);
    assert!(
        matches!(small, Value::TooSmall { cc } if (cc - volume * 1e6).abs() < 0.05),
        "{small:?}"
    );
    let v = Metric::parse("V100").expect("a metric").of(&curve, 145.0);
    let expected_m3 = 4.0 / 3.0 * PI * (core * (200.0 / 145.0 - 1.0)).powf(1.5);
    assert!(matches!(v, Value::Volume { cc, percent }
        if (cc - expected_m3 * 1e6).abs() < 1e-3 * volume * 1e6 && (percent - expected_m3 / volume * 100.0).abs() < 0.1));
}

#[test]
fn the_differential_curve_sums_to_volume_and_cumulative_curve() {
    let sphere = Structure::of_region("sphere", &Sphere { radius_m: 0.01 }, 0.5e-3);
    let curve = dvh(&sphere, |d| 100.0 + 3000.0 * d[0]);
    let bins = curve.bins(1.0, 200.0);
    let sum: f64 = bins.iter().map(|b| b.volume_m3).sum();
    assert!((sum / sphere.volume_m3() - 1.0).abs() < 1e-9);
    for i in [0, 80, 100, 127] {
        let from_here: f64 = bins[i..].iter().map(|b| b.volume_m3).sum();
        assert!((from_here - bins[i].at_least_m3).abs() < 1e-15);
        assert_eq!((bins[i].from_gy, bins[i].to_gy), (i as f64, i as f64 + 1.0));
    }
}

#[test]
fn a_closed_mesh_is_the_same_body_as_its_formula() {
    // A sphere of triangles, and the sphere itself minus the volume cut off by flat triangles.
    let (rings, around) = (60, 120);
    let radius = 0.01;
    let mut points = vec![
        [MIDDLE[0], MIDDLE[1], MIDDLE[2] + radius],
        [MIDDLE[0], MIDDLE[1], MIDDLE[2] - radius],
    ];
    for i in 1..rings {
        for j in 0..around {
            let (polar, turn) = (PI * i as f64 / rings as f64, 2.0 * PI * j as f64 / around as f64);
            let d = [polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos()];
            points.push([0, 1, 2].map(|a| MIDDLE[a] + radius * d[a]));
        }
    }
    let at = |i: usize, j: usize| 2 + (i - 1) * around + j % around;
    let mut triangles = Vec::new();
    for j in 0..around {
        triangles.push([0, at(1, j), at(1, j + 1)]);
        triangles.push([1, at(rings - 1, j + 1), at(rings - 1, j)]);
        for i in 1..rings - 1 {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    let mesh = Mesh::new(&points, &triangles).expect("closed");
    let body = Structure::of_region("mesh", &mesh, 0.4e-3);
    let exact: f64 = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| Vector3::from(from_middle(points[i])));
            a.dot(&b.cross(&c)) / 6.0
        })
        .sum();
    let off = body.volume_m3() / exact - 1.0;
    println!("mesh: volume off by {off:+.5}");
    assert!(off.abs() < 1e-3);
    let slope = 4000.0;
    let curve = dvh(&body, |d| 145.0 + slope * d[1]);
    let half = curve.at_least_m3(145.0) / exact;
    assert!((half - 0.5).abs() < 1e-3, "{half}");

    triangles.pop();
    assert!(Mesh::new(&points, &triangles).is_err_and(|e| e.to_string().contains("not closed")));
    assert!(Mesh::new(&points, &[[0, 1, 9_999_999]]).is_err());
}

/// Thick slices, rotated in space: the structure is exactly its voxels.
#[test]
fn labels_are_counted_by_their_voxels_in_place_and_volume() {
    let dims = [20, 16, 6];
    let spacing_m = [0.7e-3, 0.9e-3, 5e-3];
    let turn = Rotation3::from_euler_angles(0.3, -0.2, 0.5);
    let frame = VoxelFrame {
        directions: *turn.matrix(),
        spacing_m,
        origin_m: Vector3::new(0.02, 0.01, 0.015),
        warning: None,
    };
    let label = |i: usize, j: usize, k: usize| match (i, j, k) {
        (3..=14, 2..=12, 1..=4) if (i, j, k) == (5, 5, 2) => 2,
        (3..=14, 2..=12, 1..=4) => 1,
        _ => 0,
    };
    let mut labels = Vec::new();
    for k in 0..dims[2] {
        for j in 0..dims[1] {
            for i in 0..dims[0] {
                labels.push(label(i, j, k));
            }
        }
    }
    let voxels = Voxels {
        dims,
        labels,
        frame,
        names: BTreeMap::new(),
        also: Vec::new(),
        overlap: None,
    };
    let names = BTreeMap::from([(2, "Urethra".to_owned())]);
    let found = structures(&voxels, &names, 500_000);
    assert_eq!(
        found.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(),
        ["label 1", "Urethra"]
    );
    let voxel = spacing_m.iter().product::<f64>();
    assert!((found[0].volume_m3() / voxel - (12.0 * 11.0 * 4.0 - 1.0)).abs() < 1e-6);
    assert!((found[1].volume_m3() / voxel - 1.0).abs() < 1e-9);

    // A field along the third axis of the voxels: within the slab the curve is a straight line.
    let axis: Vector3<f64> = turn * Vector3::z();
    let field = |p: &[f64; 3]| 100.0 + 3000.0 * (Vector3::from(*p) - voxels.frame.origin_m).dot(&axis);
    let dose: Vec<f64> = found[0].points_m.iter().map(field).collect();
    let curve = Dvh::new(&dose, &found[0].volumes_m3).expect("points");
    // Slices 1 to 4 reach from half a slice before the first centre to half a slice after the last.
    let (low, high) = (100.0 + 3000.0 * 0.5 * 5e-3, 100.0 + 3000.0 * 4.5 * 5e-3);
    assert!(curve.lowest_gy() >= low && curve.highest_gy() <= high);
    let whole = found[0].volume_m3();
    for share in [0.1, 0.25, 0.5, 0.9] {
        let gy = curve.dose_of_gy(share * whole).expect("smaller");
        let expected = high - share * (high - low);
        // One voxel of 527 belongs to another structure.
        assert!(
            (gy - expected).abs() < 0.003 * (high - low),
            "{share}: {gy} and {expected}"
        );
    }
}
