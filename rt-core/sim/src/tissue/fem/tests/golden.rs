//! The 60 mm cube with a moved block in it, against another solver's solution on the same mesh.

use super::*;

/// Reads a golden file: force (N), strain energy (N mm), then places and displacements (mm).
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

/// Solves the golden problem on `n` elements along an edge.
fn solve_golden<T: Compiled>(n: usize, settings: &SolveSettings) -> (FemModel<T>, FemState<T>, FemReport) {
    let lattice = block([n; 3], 60e-3 / n as f64);
    let material = Material {
        youngs_modulus_pa: 30e3,
        ..material(0.45, FULL)
    };
    let elastic = FemSettings::homogeneous(material, 0.0);
    let model = FemModel::with_fixed_nodes(&lattice, &elastic, |p| p[2] < 1e-9).expect("valid");
    let mut state = FemState::at_rest(&model);
    let cells = [7 * n / 16, 9 * n / 16];
    let report = hold_cells(&model, &mut state, [cells; 3], [0.0, 0.0, 5e-3], settings);
    (model, state, report)
}

/// Compares displacements to the rounding of the file (a millionth of a millimetre, far below 1e-3 of any that is not
/// zero).
fn assert_agrees_with_golden<T: Compiled>(n: usize, text: &str, settings: &SolveSettings, within_mm: f64) {
    let (force_n, energy_n_mm, rows) = golden(text);
    let (model, mut state, report) = solve_golden::<T>(n, settings);
    println!("{n} elements: {report:?}");
    assert!(report.converged);
    assert!(
        (report.tip_force_n[2] / force_n - 1.0).abs() < 1e-5,
        "{}",
        report.tip_force_n[2]
    );
    let energy_here = state.grip.strain_energy_j(&model) * 1e3;
    assert!((energy_here / energy_n_mm - 1.0).abs() < 1e-5, "{energy_here} N mm");
    assert_eq!(rows.len(), 15);
    for row in rows {
        let corner = [0, 1, 2].map(|a| (row[a] * n as f64 / 60.0).round() as usize);
        let u = node_displacement_m(&state, &model, corner).expect("a node");
        for axis in 0..3 {
            let (here, there) = (u[axis] * 1e3, row[3 + axis]);
            assert!((here - there).abs() < within_mm, "{row:?} axis {axis}: {here}");
        }
    }
}

const N16: &str = include_str!("../golden/golden_nu0.45_N16.csv");
const N32: &str = include_str!("../golden/golden_nu0.45_N32.csv");

#[test]
fn agrees_with_the_golden_solutions() {
    assert_agrees_with_golden::<f64>(16, N16, &EXACT, 1e-6);
    assert_agrees_with_golden::<f64>(32, N32, &EXACT, 1e-6);
}

#[test]
fn agrees_with_the_golden_solution_in_f32() {
    let settings = SolveSettings {
        relative_tolerance: 1e-5,
        max_cycles: 30,
    };
    assert_agrees_with_golden::<f32>(32, N32, &settings, 1e-4);
}

/// Multigrid's promise: as many cycles on a fine mesh as on a coarse one.
#[test]
fn cycles_do_not_grow_with_the_mesh() {
    let settings = SolveSettings {
        relative_tolerance: 1e-6,
        max_cycles: 60,
    };
    let mut factors = Vec::new();
    for n in [16, 32, 64] {
        let (model, _, report) = solve_golden::<f32>(n, &settings);
        let factor = report.relative_residual.powf(1.0 / f64::from(report.cycles));
        println!(
            "{n}^3, {} levels: {} cycles, {factor:.2} a cycle",
            model.levels.len(),
            report.cycles
        );
        assert!(report.converged && report.cycles <= 17);
        factors.push(factor);
    }
    assert!(factors[2] < factors[0] + 0.1, "{factors:?}");
}
