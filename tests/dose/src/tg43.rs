//! TG-43 against an evaluation by another program, and its limits where the formulae are singular.

use stylet_dose::decay::Interval;
use stylet_dose::tg43::Formalism;
use stylet_dose::{DoseKernel, DosePoints, Seed, Source};

struct Reference {
    source: String,
    r_m: f64,
    theta: f64,
    one_d_gy: f64,
    two_d_gy: f64,
}

fn source(file: &str) -> Source {
    let text = std::fs::read_to_string(stylet_test_kit::repository(&format!("sources/{file}.toml")));
    Source::parse(&text.expect("a source of ours can be read")).expect("a source of ours is valid")
}

/// Written by tests/tests/dose/tg43_reference.py.
fn references() -> Vec<Reference> {
    let file = stylet_test_kit::repository("tests/dose/data/tg43_reference.csv");
    let mut reader = csv::Reader::from_path(file).expect("the table is there");
    let rows = reader.deserialize::<(String, f64, f64, f64, f64)>();
    rows.map(|row| row.expect("five fields"))
        .map(|(source, r_cm, theta_deg, one_d_gy, two_d_gy)| Reference {
            source,
            r_m: r_cm * 0.01,
            theta: theta_deg.to_radians(),
            one_d_gy,
            two_d_gy,
        })
        .collect()
}

fn off(found: f64, expected: f64) -> f64 {
    (found / expected - 1.0).abs()
}

#[test]
fn formulae_agree_with_an_independent_evaluation_on_the_axis_and_off_it() {
    let table = references();
    assert_eq!(table.len(), 874);
    for name in ["i125_6711", "pd103_200"] {
        let kernel = DoseKernel::new(&source(name), Interval::ALL);
        let (mut worst_1d, mut worst_2d) = (0.0_f64, 0.0_f64);
        for row in table.iter().filter(|row| row.source == name) {
            let (across, along) = (row.r_m * row.theta.sin(), row.r_m * row.theta.cos());
            worst_1d = worst_1d.max(off(kernel.exact_gy(Formalism::OneD, across, along), row.one_d_gy));
            worst_2d = worst_2d.max(off(kernel.exact_gy(Formalism::TwoD, across, along), row.two_d_gy));
        }
        println!("{name}: formulae off by {worst_1d:.1e} (1D), {worst_2d:.1e} (2D)");
        assert!(worst_1d < 1e-6 && worst_2d < 1e-6, "{name}: {worst_1d:e} {worst_2d:e}");
    }
}

/// The same points around a seed in several positions and directions.
#[test]
fn point_dose_agrees_with_an_independent_evaluation_in_all_directions() {
    let table = references();
    for name in ["i125_6711", "pd103_200"] {
        let kernel = DoseKernel::new(&source(name), Interval::ALL);
        let rows: Vec<&Reference> = table.iter().filter(|row| row.source == name).collect();
        let (mut worst_1d, mut worst_2d) = (0.0_f64, 0.0_f64);
        for (axis, beside) in [
            ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]),
            ([1.0, 0.0, 0.0], [0.0, 0.6, 0.8]),
            ([0.48, 0.6, -0.64], [0.8, 0.0, 0.6]),
        ] {
            let middle = [0.021, -0.034, 0.055];
            let at = |row: &&Reference| {
                let (across, along) = (row.r_m * row.theta.sin(), row.r_m * row.theta.cos());
                [0, 1, 2].map(|a| middle[a] + across * beside[a] + along * axis[a])
            };
            let points_m: Vec<[f64; 3]> = rows.iter().map(at).collect();
            let dose = |axis| {
                let seed = Seed {
                    position_m: middle,
                    axis,
                    strength_u: 0.5,
                };
                DosePoints::new(&points_m).of_seeds_gy(&kernel, &[seed])
            };
            for ((row, one_d), two_d) in rows.iter().zip(dose(None)).zip(dose(Some(axis))) {
                worst_1d = worst_1d.max(off(2.0 * one_d, row.one_d_gy));
                worst_2d = worst_2d.max(off(2.0 * two_d, row.two_d_gy));
            }
        }
        println!("{name}: dose at points off by {worst_1d:.1e} (1D), {worst_2d:.1e} (2D)");
        assert!(worst_1d < 1e-4 && worst_2d < 5e-4, "{name}: {worst_1d:e} {worst_2d:e}");
    }
}

#[test]
fn a_6711_seed_gives_19_85_gy_per_u_at_one_centimetre() {
    let gy = source("i125_6711").reference_dose_gy_per_u();
    assert!((gy - 19.85).abs() < 0.005, "{gy}");
}

#[test]
fn towards_the_axis_the_dose_has_the_limit_of_the_axis() {
    let kernel = DoseKernel::new(&source("i125_6711"), Interval::ALL);
    for along in [0.0023, 0.004, -0.01, 0.1] {
        let on_axis = kernel.exact_gy(Formalism::TwoD, 0.0, along);
        assert!(on_axis.is_finite() && on_axis > 0.0);
        for across in [1e-300, 1e-12, 1e-9, 1e-7] {
            let beside = kernel.exact_gy(Formalism::TwoD, across, along);
            assert!(
                off(beside, on_axis) < 1e-3,
                "{across} beside {along}: {beside} and {on_axis}"
            );
        }
    }
}

#[test]
fn inside_the_capsule_the_dose_is_that_of_its_surface() {
    let kernel = DoseKernel::new(&source("i125_6711"), Interval::ALL);
    let at = |across, along| kernel.exact_gy(Formalism::TwoD, across, along);
    // The capsule is 0.8 mm thick and 4.5 mm long.
    assert_eq!(at(0.0, 0.0), at(0.0004, 0.0));
    assert_eq!(at(0.0002, 0.001), at(0.0004, 0.001));
    assert_eq!(at(0.0, 0.0022), at(0.0, 0.00225));
    assert_eq!(at(0.0, -0.0022), at(0.0, -0.00225));
    assert!(at(0.00041, 0.0) < at(0.0004, 0.0));
}

#[test]
fn a_point_source_falls_with_the_square_of_the_distance_times_g() {
    let text = r#"
[source]
model = "point"
nuclide = "X-1"
half_life_days = 1
dose_rate_constant = 1
[radial]
r_cm = [0.1, 1, 10]
g_point = [1, 1, 1]
"#;
    let kernel = DoseKernel::new(&Source::parse(text).expect("valid"), Interval::ALL);
    let at = |r| kernel.exact_gy(Formalism::OneD, r, 0.0);
    for r in [0.002, 0.01, 0.05] {
        assert!(off(at(r) * r * r, at(0.01) * 1e-4) < 1e-12);
    }
}
