//! Claims about a step: it solves what it says, on hard bodies too, from tick to tick, and refuses what it cannot do.

use super::*;
use nalgebra::{DMatrix, DVector};
use stylet_heap as heap;

/// Returns the nodes by place, and the dense matrix of a model with springs, column by column from unit displacements.
fn dense(model: &FemModel<f64>) -> (Vec<usize>, DMatrix<f64>) {
    use crate::tissue::fem::smooth::Product;
    use crate::tissue::fem::sweep::{Planes, sweep, zeros};
    let level = &model.levels[0];
    let nodes: Vec<usize> = (0..level.grid.len())
        .filter(|&n| level.inverse_diagonal[n] != 0.0)
        .collect();
    let mut matrix = DMatrix::zeros(3 * nodes.len(), 3 * nodes.len());
    let mut work = Planes::new(level.grid.stride * level.grid.nodes[1]);
    let (mut x, mut q) = (zeros(level.grid.len()), zeros(level.grid.len()));
    for column in 0..3 * nodes.len() {
        x[column % 3][nodes[column / 3]] = 1.0;
        let mut op = Product {
            q: &mut q,
            inverse_diagonal: &level.inverse_diagonal,
            dot: 0.0,
        };
        sweep(level, &mut x, &mut work, 0..level.grid.nodes[2], &mut op);
        x[column % 3][nodes[column / 3]] = 0.0;
        for row in 0..3 * nodes.len() {
            matrix[(row, column)] = q[row % 3][nodes[row / 3]];
        }
    }
    (nodes, matrix)
}

/// Brute force: eliminate the held nodes and solve by Cholesky.
#[test]
fn step_finds_what_a_dense_solver_finds() {
    let lattice = lattice_of(&test_bodies::speckle(11));
    let model = FemModel::<f64>::new(&lattice, &two_materials(&lattice, 20.0, 1e6)).expect("valid");
    let element = lattice.element_count() as u32 / 2;
    let by_m = [0.4e-3, -0.2e-3, 0.7e-3];
    // The body hangs together by edges and corners in places, so forces must be small for places to be right.
    let settings = SolveSettings {
        relative_tolerance: 1e-13,
        ..EXACT
    };
    let mut state = FemState::at_rest(&model);
    let report = step(&model, &mut state, Some(patch(&lattice, element, by_m, 0.0)), &settings);
    assert!(report.converged, "{report:?}");

    let (nodes, matrix) = dense(&model);
    let held = state.grip.nodes();
    let is_held: Vec<bool> = nodes.iter().map(|&n| held.contains(&(n as u32))).collect();
    let free: Vec<usize> = (0..3 * nodes.len()).filter(|&n| !is_held[n / 3]).collect();
    let known = DVector::from_fn(3 * nodes.len(), |n, _| if is_held[n / 3] { by_m[n % 3] } else { 0.0 });
    let load = &matrix * &known;
    let inner = DMatrix::from_fn(free.len(), free.len(), |i, j| matrix[(free[i], free[j])]);
    let rhs = DVector::from_fn(free.len(), |i, _| -load[free[i]]);
    let solved = inner.cholesky().expect("positive definite").solve(&rhs);
    let mut all = known;
    free.iter().enumerate().for_each(|(i, &n)| all[n] = solved[i]);
    let forces = &matrix * &all;
    for (n, &node) in nodes.iter().enumerate() {
        let place = model.levels[0].grid.place(node);
        let corner = [0, 1, 2].map(|a| place[a] + model.low_cell[a]);
        let u = node_displacement_m(&state, &model, corner).expect("a node");
        assert!(
            (0..3).all(|a| (u[a] - all[3 * n + a]).abs() < 1e-9 * 1e-3),
            "{corner:?}"
        );
    }
    for axis in 0..3 {
        let force: f64 = (0..nodes.len())
            .filter(|&n| is_held[n])
            .map(|n| forces[3 * n + axis])
            .sum();
        assert!((force - report.tip_force_n[axis]).abs() < 1e-7 * force.abs());
    }
    let work_j: f64 = (0..3).map(|a| 0.5 * by_m[a] * report.tip_force_n[a]).sum();
    assert!(
        (state.grip.strain_energy_j(&model) / work_j - 1.0).abs() < 1e-7,
        "energy is half of force times way"
    );
}

/// Holds one corner of a body whose cells alternate between soft and stiff.
fn hold_corner<T: Compiled>(
    lattice: &Arc<Lattice>,
    contrast: f64,
    settings: &SolveSettings,
) -> (FemState<T>, FemReport) {
    let model = FemModel::<T>::new(lattice, &two_materials(lattice, contrast, 1e5)).expect("valid");
    let mut state = FemState::at_rest(&model);
    let held = patch(lattice, 0, [1e-3, -0.5e-3, 0.8e-3], 0.0);
    let report = step(&model, &mut state, Some(held), settings);
    (state, report)
}

/// With contrast 1:1000 the rounding of f32 leaves more force on the soft cells than 1e-4 of the load, so f32 must be
/// near the solution there instead.
#[test]
fn hard_bodies_converge() {
    let bodies = [
        ("hole", test_bodies::with_hole()),
        ("horseshoe", test_bodies::horseshoe()),
        ("two parts", test_bodies::two_parts()),
        ("speckle", test_bodies::speckle(7)),
        ("sheet", test_bodies::block([12, 9, 1])),
        ("wall", test_bodies::block([1, 9, 7])),
        ("line", test_bodies::block([15, 1, 1])),
        ("one", test_bodies::block([1, 1, 1])),
    ];
    let settings = SolveSettings {
        relative_tolerance: 1e-4,
        max_cycles: 400,
    };
    // The cells at random, joined by edges and corners, are the slow ones.
    let patient = SolveSettings {
        max_cycles: 3000,
        ..EXACT
    };
    for (name, labels) in bodies {
        let lattice = lattice_of(&labels);
        let (_, report) = hold_corner::<f32>(&lattice, 1.0, &settings);
        println!("{name}: {} cycles", report.cycles);
        assert!(
            report.converged && report.max_displacement.is_finite(),
            "{name} {report:?}"
        );
        let (solved, report) = hold_corner::<f64>(&lattice, 1000.0, &patient);
        let (state, rough) = hold_corner::<f32>(&lattice, 1000.0, &settings);
        let pairs = (0..3).flat_map(|a| state.displacement(a).iter().zip(solved.displacement(a)));
        let off = pairs.fold(0.0, |m: f32, (a, b)| m.max((a - b).abs())) / report.max_displacement;
        let (exact, residual) = (report.cycles, rough.relative_residual);
        println!("{name}, contrast 1000: f64 {exact} cycles; f32 residual {residual:.1e}, {off:.1e} of travel off");
        assert!(report.converged && off < 1e-2, "{name} {report:?}");
    }
}

/// A part that nothing holds in place has no unique equilibrium: it stays at rest until it is held.
#[test]
fn loose_part_stays_at_rest() {
    let lattice = lattice_of(&test_bodies::two_parts());
    let elastic = FemSettings::homogeneous(material(0.45, MEAN), 0.0);
    let model = FemModel::<f32>::new(&lattice, &elastic).expect("valid");
    let mut state = FemState::at_rest(&model);
    let settings = SolveSettings {
        relative_tolerance: 1e-5,
        max_cycles: 40,
    };
    for held_part in [0, 1] {
        let element = if held_part == 0 {
            0
        } else {
            lattice.element_count() as u32 - 1
        };
        let held = patch(&lattice, element, [1e-3, 0.0, 0.0], 0.0);
        let report = step(&model, &mut state, Some(held), &settings);
        assert!(report.converged, "{report:?}");
        for element in 0..lattice.element_count() as u32 {
            let on_low_side = lattice.cell(element)[0] < 7;
            let u = state.displacement(0)[element as usize] * lattice.spacing_m as f32;
            let expected = if on_low_side == (held_part == 0) { 1e-3 } else { 0.0 };
            assert!((u - expected).abs() < 1e-6, "{element}: {u}");
        }
    }
}

#[test]
fn fixed_structures_do_not_move() {
    let lattice = block([10, 8, 6], 1.5e-3);
    let is_fixed = |element| lattice.cell(element)[0] < 3;
    let elastic = FemSettings {
        structures: vec![Structure::Elastic(material(0.45, MEAN)), Structure::Fixed],
        structure_of: (0..480).map(|e| u8::from(is_fixed(e))).collect(),
        foundation_pa_per_m: 0.0,
        surroundings: Vec::new(),
    };
    let model = FemModel::<f32>::new(&lattice, &elastic).expect("valid");
    let mut state = FemState::at_rest(&model);
    let settings = SolveSettings {
        relative_tolerance: 1e-4,
        max_cycles: 40,
    };
    let element = lattice.element_of_cell(7, 4, 3).expect("inside");
    let report = step(
        &model,
        &mut state,
        Some(patch(&lattice, element, [1e-3; 3], 0.0)),
        &settings,
    );
    assert!(report.converged && report.moved > 300, "{report:?}");
    let moved = |e: u32| (0..3).any(|a| state.displacement(a)[e as usize] != 0.0);
    assert!((0..480).all(|e| moved(e) != is_fixed(e)));
    // Held inside what cannot move: refused.
    let inside = lattice.element_of_cell(0, 4, 3).expect("inside");
    let report = step(
        &model,
        &mut state,
        Some(patch(&lattice, inside, [1e-3; 3], 0.0)),
        &settings,
    );
    assert_eq!(report.held, HeldOutcome::Refused);
}

/// While the patch stays, every displacement of it is answered by superposition: exactly, and without a cycle.
#[test]
fn same_patch_is_answered_by_superposition() {
    let lattice = lattice_of(&test_bodies::with_hole());
    let model = FemModel::<f64>::new(&lattice, &two_materials(&lattice, 5.0, 1e5)).expect("valid");
    let mut state = FemState::at_rest(&model);
    let ways = [
        [0.0, 0.0, 1e-3],
        [2e-4, 0.0, 1.3e-3],
        [2e-4, -5e-4, 1.5e-3],
        [-3e-4, 1e-4, -1e-3],
    ];
    for (n, by_m) in ways.into_iter().enumerate() {
        let held = patch(&lattice, 300, by_m, 4e-3);
        let report = step(&model, &mut state, Some(held), &EXACT);
        assert!(report.converged);
        assert_eq!(report.cycles == 0, n == 3, "three directions span space: {report:?}");
        let mut fresh = FemState::at_rest(&model);
        let cold = step(&model, &mut fresh, Some(held), &EXACT);
        for axis in 0..3 {
            assert!((cold.tip_force_n[axis] - report.tip_force_n[axis]).abs() < 1e-6 * cold.tip_force_n[2].abs());
            for (a, b) in state.displacement(axis).iter().zip(fresh.displacement(axis)) {
                assert!((a - b).abs() < 1e-6, "{a} {b}");
            }
        }
    }
    let report = step(&model, &mut state, None, &EXACT);
    assert!(report.converged && report.tip_force_n == [0.0; 3] && report.max_displacement == 0.0);
}

/// The live setting: at most 4 cycles a tick. RMS over the body, relative to how far the patch is from rest.
#[test]
fn warm_started_insertion_stays_within_one_percent() {
    let scene = Scene::builtin("paper").expect("built in");
    let lattice = &scene.lattice;
    let elastic = FemSettings::homogeneous(material(0.45, MEAN), 3e5);
    let live = FemModel::<f32>::new(lattice, &elastic).expect("valid");
    let exact = FemModel::<f64>::new(lattice, &elastic).expect("valid");
    let (mut state, mut solved) = (FemState::at_rest(&live), FemState::at_rest(&exact));
    let settings = SolveSettings {
        relative_tolerance: 1e-3,
        max_cycles: 4,
    };
    let (mut by_m, mut worst) = (0.0, 0.0_f64);
    for tick in 1..=120 {
        // 50 mm/s at 200 Hz; past 8 mm the tissue follows by half, and the tip passes on to the next element.
        let tip_m = 0.25e-3 * f64::from(tick);
        by_m += if tip_m <= 8e-3 { 0.25e-3 } else { 0.125e-3 };
        let k = 72 + ((tip_m - by_m) / lattice.spacing_m) as usize;
        let element = lattice.element_of_cell(53, 31, k).expect("in the gland");
        let held = patch(lattice, element, [0.0, 0.1 * by_m, by_m], 4e-3);
        let report = step(&live, &mut state, Some(held), &settings);
        assert!(report.cycles <= 4 && report.held == HeldOutcome::Followed);
        assert!(step(&exact, &mut solved, Some(held), &EXACT).converged);
        let squares = (0..3).flat_map(|a| state.displacement(a).iter().zip(solved.displacement(a)));
        let sum: f64 = squares.map(|(a, b)| f64::from(a - b).powi(2)).sum();
        let rms_m = (sum / lattice.element_count() as f64).sqrt() * lattice.spacing_m;
        if rms_m / by_m > worst {
            worst = rms_m / by_m;
            println!("tick {tick}: {:.3} %", 100.0 * worst);
        }
    }
    println!("worst tick: {:.3} % of travel", 100.0 * worst);
    assert!(worst < 0.01, "{worst}");
}

#[test]
fn steps_make_no_heap_calls_and_give_the_same_bytes() {
    let scene = Scene::builtin("paper").expect("built in");
    let elastic = FemSettings::homogeneous(material(0.49, MEAN), 3e5);
    let model = FemModel::<f32>::new(&scene.lattice, &elastic).expect("valid");
    let settings = SolveSettings {
        relative_tolerance: 1e-3,
        max_cycles: 2,
    };
    let run = || {
        let mut state = FemState::at_rest(&model);
        let before = heap::calls_of_this_thread();
        for n in 0..12 {
            let element = scene.lattice.element_of_cell(53, 31, 80 + n / 3).expect("inside");
            let by_m = [1e-4 * n as f64, 0.0, 1e-3];
            let held = (n != 7).then(|| patch(&scene.lattice, element, by_m, 4e-3));
            step(&model, &mut state, held, &settings);
        }
        assert_eq!(heap::calls_of_this_thread(), before);
        [0, 1, 2].map(|a| state.displacement(a).iter().map(|v| v.to_bits()).collect::<Vec<_>>())
    };
    assert!(run() == run());
}
