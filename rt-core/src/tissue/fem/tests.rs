//! Claims about the elastic body against independent solutions.

use super::solve::hold_cells;
use super::*;
use crate::scene::{Labels, Lattice, Scene};

fn cube(n: usize, edge_m: f64) -> std::sync::Arc<Lattice> {
    let labels = Labels {
        dims: [n; 3],
        spacing_m: edge_m / n as f64,
        cells: vec![1; n * n * n],
        structures: Vec::new(),
    };
    Scene::from_labels("cube", &labels).expect("valid labels").lattice
}

/// A golden file: force (N), strain energy (N mm), then places and displacements (mm).
fn golden(text: &str) -> (f64, f64, Vec<[f64; 6]>) {
    let after = |key: &str| {
        let from = text.find(key).expect(key) + key.len();
        let number = text[from..].split_whitespace().next().expect("a number");
        number.parse().expect("a number")
    };
    let rows = text
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
    let rows = rows.map(|line| {
        let mut numbers = line.split(',').map(|field| field.parse().expect("a number"));
        std::array::from_fn(|_| numbers.next().expect("six fields"))
    });
    (after("Fz_on_block="), after("strain energy="), rows.collect())
}

fn assert_agrees_with_golden(n: usize, text: &str) {
    let (force_n, energy_n_mm, rows) = golden(text);
    let lattice = cube(n, 60e-3);
    let material = Material {
        youngs_modulus_pa: 30e3,
        poisson_ratio: 0.45,
        integration: Integration::Full,
    };
    let settings = FemSettings::homogeneous(material, 0.0);
    let model = FemModel::<f64>::with_fixed_nodes(&lattice, &settings, |p| p[2] < 1e-9).expect("valid");
    let mut state = FemState::at_rest(&model);
    let block = [7 * n / 16, 9 * n / 16];
    let solve = SolveSettings {
        relative_tolerance: 1e-9,
        max_cycles: 100,
    };
    let report = hold_cells(&model, &mut state, [block; 3], [0.0, 0.0, 5e-3], &solve);
    println!("{report:?}");
    assert!(report.converged);
    assert!(
        (report.tip_force_n[2] / force_n - 1.0).abs() < 1e-5,
        "{}",
        report.tip_force_n[2]
    );
    let energy_n_mm_here = state.strain_energy_j(&model) * 1e3;
    assert!(
        (energy_n_mm_here / energy_n_mm - 1.0).abs() < 1e-5,
        "{energy_n_mm_here}"
    );
    assert_eq!(rows.len(), 15);
    for row in rows {
        let corner = [0, 1, 2].map(|a| (row[a] * n as f64 / 60.0).round() as usize);
        let u = state.node_displacement_m(&model, corner).expect("a node");
        for axis in 0..3 {
            let (here, there) = (u[axis] * 1e3, row[3 + axis]);
            assert!((here - there).abs() < 2e-6, "{row:?} axis {axis}: {here} {there}");
        }
    }
}

#[test]
fn agrees_with_the_golden_solution_of_16_elements() {
    assert_agrees_with_golden(16, include_str!("golden/golden_nu0.45_N16.csv"));
}

#[test]
fn agrees_with_the_golden_solution_of_32_elements() {
    assert_agrees_with_golden(32, include_str!("golden/golden_nu0.45_N32.csv"));
}
