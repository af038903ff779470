//! Claims about what a step and a model refuse.

use super::*;

#[test]
fn what_cannot_be_followed_is_refused_and_changes_nothing() {
    let lattice = block([6, 6, 6], 1.5e-3);
    let model = FemModel::<f32>::new(&lattice, &two_materials(&lattice, 2.0, 1e5)).expect("valid");
    let mut state = FemState::at_rest(&model);
    let settings = SolveSettings {
        relative_tolerance: 1e-4,
        max_cycles: 40,
    };
    let good = patch(&lattice, 100, [0.0, 0.0, 1e-3], 2e-3);
    assert!(step(&model, &mut state, Some(good), &settings).converged);
    let before: Vec<Vec<f32>> = (0..3).map(|a| state.displacement(a).to_vec()).collect();
    let bad = [
        Held { element: 216, ..good },
        Held {
            patch_m: f64::NAN,
            ..good
        },
        Held { patch_m: -1.0, ..good },
        Held {
            patch_m: f64::INFINITY,
            ..good
        },
        Held {
            position_m: [f64::NAN, 0.0, 0.0],
            ..good
        },
        Held {
            position_m: [0.0, f64::INFINITY, 0.0],
            ..good
        },
        Held {
            position_m: [0.0, 0.0, 10.0],
            ..good
        },
    ];
    for held in bad {
        let report = step(&model, &mut state, Some(held), &settings);
        assert_eq!(report.held, HeldOutcome::Refused, "{held:?}");
        assert!(!report.converged);
        assert!((0..3).all(|a| state.displacement(a) == before[a]));
    }
    let other = FemModel::<f32>::new(
        &block([5, 5, 5], 1.5e-3),
        &FemSettings::homogeneous(Material::PROSTATE, 1e5),
    );
    let report = step(&other.expect("valid"), &mut state, Some(good), &settings);
    assert_eq!(report.held, HeldOutcome::Refused);
    assert!(step(&model, &mut state, Some(good), &settings).converged);
}

#[test]
fn every_problem_with_the_settings_is_listed() {
    let lattice = block([2, 2, 2], 1.5e-3);
    let bad = Material {
        youngs_modulus_pa: f64::NAN,
        poisson_ratio: 0.5,
        integration: FULL,
    };
    let settings = FemSettings {
        structures: vec![Structure::Elastic(bad)],
        structure_of: vec![0, 0, 1],
        foundation_pa_per_m: -1.0,
        surroundings: Vec::new(),
    };
    let problems = FemModel::<f32>::new(&lattice, &settings).expect_err("five problems").0;
    assert_eq!(problems.len(), 5, "{problems:?}");
    let none = FemSettings {
        structures: Vec::new(),
        ..FemSettings::homogeneous(Material::PROSTATE, 0.0)
    };
    let problems = FemModel::<f32>::new(&lattice, &none).expect_err("no structure").0;
    assert_eq!(problems, [FemProblem::NoStructures]);
    assert!(problems[0].to_string().contains("at least 1"));
}

/// Such a state used to be followed out of its bounds.
#[test]
fn state_of_another_body_with_as_many_nodes_is_refused() {
    let settings = FemSettings::homogeneous(Material::PROSTATE, 1e5);
    let model = |dims| FemModel::<f32>::new(&block(dims, 1.5e-3), &settings).expect("valid");
    let (upright, flat) = (model([6, 4, 8]), model([6, 8, 4]));
    let mut state = FemState::at_rest(&flat);
    let held = patch(upright.lattice(), 100, [0.0, 0.0, 1e-3], 0.0);
    let live = SolveSettings {
        relative_tolerance: 1e-3,
        max_cycles: 2,
    };
    assert_eq!(step(&upright, &mut state, Some(held), &live).held, HeldOutcome::Refused);
    prepare(&upright, &mut state, Some(held), &live);
    assert_eq!(step(&upright, &mut state, None, &live).held, HeldOutcome::Refused);
}
