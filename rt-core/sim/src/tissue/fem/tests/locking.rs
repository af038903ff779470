//! Near incompressibility: what locks, what does not, and what it costs.

use super::*;

/// Bends a cantilever of 16 x 4 x 2 mm, clamped at x = 0; returns the force that moves its last millimetre sideways by
/// 0.1 mm.
fn cantilever(poisson_ratio: f64, integration: Integration, refined: usize) -> f64 {
    let (length, height, depth) = (16 * refined, 4 * refined, 2 * refined);
    let h = 1e-3 / refined as f64;
    let lattice = block([length, height, depth], h);
    let settings = FemSettings::homogeneous(material(poisson_ratio, integration), 0.0);
    let model = FemModel::<f64>::with_fixed_nodes(&lattice, &settings, |p| p[0] < 1e-9).expect("valid");
    let mut state = FemState::at_rest(&model);
    let cells = [[length - refined, length], [0, height], [0, depth]];
    let report = hold_cells(&model, &mut state, cells, [0.0, 1e-4, 0.0], &EXACT);
    assert!(report.converged, "{report:?}");
    println!(
        "nu {poisson_ratio}, {integration:?}, {refined}: {} cycles, {} N",
        report.cycles, report.tip_force_n[1]
    );
    report.tip_force_n[1]
}

/// At nu 0.499 the mean dilatation stays where a fine mesh goes, full integration is far too stiff.
#[test]
fn mean_dilatation_does_not_lock() {
    for (poisson_ratio, most) in [(0.45, 1.15), (0.49, 1.15), (0.499, 1.15)] {
        let fine = cantilever(poisson_ratio, MEAN, 4);
        let coarse = cantilever(poisson_ratio, MEAN, 1) / fine;
        let full = cantilever(poisson_ratio, FULL, 1) / fine;
        println!("nu {poisson_ratio}: mean dilatation {coarse:.3}, full {full:.3} of the fine mesh");
        assert!(coarse < most && coarse > 0.9, "{coarse}");
        assert!(full > coarse);
        if poisson_ratio == 0.499 {
            assert!(full > 1.5, "full integration should lock here: {full}");
        }
    }
}

/// Confined compression: a closed form that near incompressibility makes stiff, M = lambda + 2 mu.
#[test]
fn oedometer_has_the_modulus_of_the_closed_form() {
    let lattice = block([4, 4, 6], 1e-3);
    for poisson_ratio in [0.3, 0.49, 0.499] {
        let elastic = material(poisson_ratio, MEAN);
        let (lambda, mu) = elastic.lame_pa();
        let model = FemModel::<f64>::new(&lattice, &FemSettings::homogeneous(elastic, 0.0)).expect("valid");
        let grid = &model.levels[0].grid;
        let mut state = FemState::at_rest(&model);
        // Confinement is a displacement field: u_z = strain z, which must carry the confined modulus' energy.
        let strain = 0.01;
        for node in 0..grid.len() {
            state.grip.responses[0].u[2][node] = strain * grid.place(node)[2] as f64 * lattice.spacing_m;
        }
        state.grip.responses[0].weight_m = 1.0;
        state.grip.count = 1;
        let energy_j = 0.5 * (lambda + 2.0 * mu) * strain * strain * lattice.volume_m3();
        assert!((state.grip.strain_energy_j(&model) / energy_j - 1.0).abs() < 1e-10);
    }
}

/// Stated, not hidden: cycles to 1e-4 in f32 on the gland, as nu comes near 0.5.
#[test]
fn cycles_towards_incompressibility() {
    let scene = Scene::builtin("paper").expect("built in");
    let settings = SolveSettings {
        relative_tolerance: 1e-4,
        max_cycles: 100,
    };
    for (poisson_ratio, most) in [(0.3, 10), (0.45, 14), (0.49, 28), (0.499, 75)] {
        let elastic = FemSettings::homogeneous(material(poisson_ratio, MEAN), 3e5);
        let model = FemModel::<f32>::new(&scene.lattice, &elastic).expect("valid");
        let mut state = FemState::at_rest(&model);
        let element = scene.lattice.element_of_cell(53, 31, 88).expect("in the gland");
        let mut position_m = scene.lattice.rest_m(element);
        position_m[2] += 2e-3;
        let held = Held {
            element,
            position_m,
            patch_m: 4e-3,
        };
        let report = step(&model, &mut state, Some(held), &settings);
        println!(
            "nu {poisson_ratio}: {} cycles to {:.1e}",
            report.cycles, report.relative_residual
        );
        assert!(report.converged && report.cycles <= most, "{report:?}");
    }
}
