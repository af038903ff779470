//! Claims about the step, on bodies from a block to a horseshoe.

mod carried;
mod queue;
mod reference;
mod scene;
mod state;
mod violation;
mod wander;

use super::*;
use crate::limits::TissueParameters;
use crate::scene::Labels;
use crate::scene::test_bodies;
use crate::tissue::{Held, HeldOutcome, Solve};
use stylet_random::Random;
use violation::largest_violation;
use wander::{held_at, model_of, model_with, oracle_violation, paper, smallest_corner, wander};

#[test]
fn no_limit_is_violated_on_any_body_at_any_speed() {
    let bodies = [
        ("block", test_bodies::block([12, 10, 9])),
        ("hole", test_bodies::with_hole()),
        ("horseshoe", test_bodies::horseshoe()),
        ("two parts", test_bodies::two_parts()),
        ("sheet", test_bodies::block([12, 10, 1])),
        ("upright sheet", test_bodies::block([1, 9, 12])),
        ("line", test_bodies::block([1, 1, 20])),
        ("one element", test_bodies::block([1, 1, 1])),
        ("speckle", test_bodies::speckle(3)),
    ];
    for (name, labels) in bodies {
        for per_tick in [0.04, 0.5, 3.0] {
            let run = wander(&labels, &TissueParameters::default(), per_tick, 1000, 5);
            println!(
                "{name}, {per_tick} per tick: {:?} {:?}, {} passes at most, {} in all, smallest corner {:.3}",
                run.worst_solve, run.solves, run.most_passes, run.passes, run.smallest_corner
            );
        }
    }
}

#[test]
fn re_anchoring_reaches_the_limits_from_any_state() {
    let parameters = TissueParameters::default();
    let model = model_of(&test_bodies::two_parts());
    let mut random = Random(8);
    for _ in 0..50 {
        let mut state = TissueState::at_rest(&model);
        let size = 1e-3 + 30.0 * random.unit();
        for element in (0..model.element_count()).filter(|&e| model.part(e as u32) == 0) {
            state.put(element, [(); 3].map(|()| (size * random.signed()) as f32));
        }
        let held = state.deformed(&model).displacement(3);
        sweep::Pass::new(&model, &mut state, [0; 3], 4e-6).reanchor(3);
        assert!(oracle_violation(&model, &state, &parameters) <= parameters.residual_tolerance);
        assert_eq!(state.deformed(&model).displacement(3), held);
    }
}

#[test]
fn rigid_limits_move_the_body_as_a_whole() {
    let rigid = TissueParameters {
        min_stretch: 1.0,
        max_stretch: 1.0,
        shear_deg: 0.0,
        shear_vert_deg: 0.0,
        ..TissueParameters::default()
    };
    for labels in [test_bodies::block([8, 7, 6]), test_bodies::horseshoe()] {
        let run = wander(&labels, &rigid, 0.3, 300, 9);
        println!("rigid: {:?}, {} passes", run.worst_solve, run.most_passes);
    }
}

#[test]
fn links_of_fixed_length_may_still_shear() {
    let stiff = TissueParameters {
        min_stretch: 1.0,
        max_stretch: 1.0,
        ..TissueParameters::default()
    };
    for labels in [test_bodies::block([8, 7, 6]), test_bodies::with_hole()] {
        wander(&labels, &stiff, 0.3, 300, 9);
    }
}

#[test]
fn shear_just_inside_equation_1_is_solved() {
    let wide = TissueParameters {
        shear_deg: 60.0,
        shear_vert_deg: 12.6,
        ..TissueParameters::default()
    };
    assert!(crate::limits::folding([60.0, 12.6, 12.6]) > 0.99);
    let run = wander(&test_bodies::with_hole(), &wide, 1.0, 300, 4);
    println!("smallest corner {}", run.smallest_corner);
}

#[test]
fn a_long_step_needs_more_than_one_pass() {
    let model = paper();
    let element = model.lattice().element_of_cell(53, 31, 88).expect("inside");
    let mut state = TissueState::at_rest(&model);
    let held = held_at(&model, element, [3.0, -2.0, 5.0]);
    queue::QueuePass::new(&model).run(&model, &mut state, held);
    assert!(largest_violation(&model, &state) > 0.1);
    let report = step(&model, &mut state, Some(held), 0.0);
    assert!(report.converged && report.solve == Solve::Sweeps, "{report:?}");
}

#[test]
fn body_returns_to_rest_when_nothing_is_held() {
    let model = paper();
    let element = model.lattice().element_of_cell(53, 31, 75).expect("inside");
    let mut state = TissueState::at_rest(&model);
    step(
        &model,
        &mut state,
        Some(held_at(&model, element, [2.0, 1.0, 9.0])),
        1e-3,
    );
    let mut last = f32::INFINITY;
    for _ in 0..3000 {
        let report = step(&model, &mut state, None, 4e-3);
        assert!(report.converged && report.max_displacement <= last && report.passes == 0);
        last = report.max_displacement;
    }
    assert!(last < 1e-3, "{last} elements from rest");
}

#[test]
fn a_free_body_comes_to_rest_without_denormals() {
    let model = model_of(&test_bodies::block([4, 4, 4]));
    let mut state = TissueState::at_rest(&model);
    let held = held_at(&model, 9, [1.0, 1.0, 1.0]);
    step(&model, &mut state, Some(held), 1e-3);
    for _ in 0..20_000 {
        step(&model, &mut state, None, 4e-3);
        assert!(!state.u.iter().flatten().any(|u| u.is_subnormal()));
    }
    assert_eq!(state.deformed(&model).displacement(9), [0.0; 3]);
}

#[test]
fn insert_and_retract_cycles_do_not_drift() {
    let model = model_of(&test_bodies::block([9, 9, 12]));
    let element = model.lattice().element_of_cell(4, 4, 2).expect("inside");
    let mut state = TissueState::at_rest(&model);
    let mut cycle = || {
        for way in [1.0, 3.0, 6.0, 3.0, 0.0] {
            step(
                &model,
                &mut state,
                Some(held_at(&model, element, [0.0, 0.0, way])),
                1e-3,
            );
        }
        let scale = state.scale();
        state
            .u
            .clone()
            .map(|c| c.into_iter().map(|u| u * scale).collect::<Vec<_>>())
    };
    (0..5000).for_each(|_| drop(cycle()));
    let settled = cycle();
    (0..5000).for_each(|_| drop(cycle()));
    let later = cycle();
    for (a, b) in settled.iter().flatten().zip(later.iter().flatten()) {
        assert!((a - b).abs() < 1e-4, "drift from {a} to {b}");
    }
}

#[test]
fn parts_that_hold_nothing_stay_at_rest() {
    let model = model_of(&test_bodies::two_parts());
    let mut state = TissueState::at_rest(&model);
    step(&model, &mut state, Some(held_at(&model, 0, [9.0, 9.0, -9.0])), 1e-3);
    let other = model.lattice().element_of_cell(8, 0, 0).expect("second part");
    assert_eq!(state.deformed(&model).displacement(other), [0.0; 3]);
    assert_ne!(state.deformed(&model).displacement(6), [0.0; 3]);
}

#[test]
fn bad_input_is_refused_and_reported() {
    let model = model_of(&test_bodies::block([4, 4, 4]));
    let mut state = TissueState::at_rest(&model);
    let held = |element, z| Held {
        element,
        position_m: [0.0, 0.0, z],
        patch_m: 0.0,
    };
    for bad in [held(3, f64::NAN), held(3, f64::INFINITY), held(3, 1e30), held(64, 0.0)] {
        let report = step(&model, &mut state, Some(bad), f64::NAN);
        assert_eq!(report.held, HeldOutcome::Refused);
        assert!(report.converged && report.max_displacement == 0.0);
    }
    let other = model_of(&test_bodies::block([5, 4, 4]));
    assert!(!step(&other, &mut state, None, 1e-3).converged);
}

#[test]
fn place_in_the_grid_does_not_change_the_result() {
    let near = test_bodies::block([6, 6, 6]);
    let mut far = Labels {
        dims: [6, 6, 1024],
        cells: vec![0; 36 * 1024],
        ..near.clone()
    };
    far.cells[36 * 1018..].fill(1);
    let results = [near, far].map(|labels| {
        let model = model_of(&labels);
        let mut state = TissueState::at_rest(&model);
        for tick in 0..100 {
            let way = [0.0, 0.25, 0.0625 * f64::from(tick)];
            let report = step(&model, &mut state, Some(held_at(&model, 40, way)), 1e-3);
            assert!(report.converged);
        }
        let scale = state.scale();
        state.u.map(|c| c.into_iter().map(|u| u * scale).collect::<Vec<_>>())
    });
    for (a, b) in results[0].iter().flatten().zip(results[1].iter().flatten()) {
        assert!((a - b).abs() < 1e-5, "{a} and {b}");
    }
}
