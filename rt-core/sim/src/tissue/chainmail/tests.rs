//! Claims about the step, on bodies from a block to a horseshoe.

mod relax;
mod scene;
mod state;

use super::*;
use crate::limits::TissueParameters;
use crate::scene::test_bodies::{self, Random};
use crate::scene::{Labels, Scene};
use crate::tissue::{Held, HeldOutcome, Solve, largest_violation};

pub(super) fn model_with(labels: &Labels, parameters: &TissueParameters) -> ChainMail {
    let scene = Scene::from_labels("test", labels).expect("valid labels");
    ChainMail::new(&scene, parameters.validate().expect("valid limits"))
}

pub(super) fn model_of(labels: &Labels) -> ChainMail {
    model_with(labels, &TissueParameters::default())
}

pub(super) fn paper() -> ChainMail {
    let scene = Scene::builtin("paper").expect("built in");
    let limits = TissueParameters::default().validate().expect("valid");
    ChainMail::new(&scene, limits)
}

/// Held at its rest position moved by `way`, in elements.
pub(super) fn held_at(model: &ChainMail, element: u32, way: [f64; 3]) -> Held {
    let rest = model.lattice().rest_m(element);
    let h = model.lattice().spacing_m;
    Held {
        element,
        position_m: [0, 1, 2].map(|a| rest[a] + h * way[a]),
        patch_m: 0.0,
    }
}

/// Largest violation, by positions in f64 over each element's upper neighbours: shares no code with the step.
pub(super) fn oracle_violation(model: &ChainMail, state: &TissueState, parameters: &TissueParameters) -> f64 {
    let h = model.lattice().spacing_m;
    let mut worst = 0.0_f64;
    for element in 0..model.element_count() as u32 {
        let x = state.position_m(model, element);
        let around = model.lattice().neighbours(element);
        for a in 0..3 {
            let Some(neighbour) = around[2 * a + 1] else {
                continue;
            };
            let y = state.position_m(model, neighbour);
            let d = [0, 1, 2].map(|n| (y[n] - x[n]) / h);
            let angle = [parameters.shear_deg, parameters.shear_vert_deg][usize::from(a > 0)];
            let shear = angle.to_radians().tan() * d[a];
            worst = worst
                .max(parameters.min_stretch - d[a])
                .max(d[a] - parameters.max_stretch);
            for b in (0..3).filter(|&b| b != a) {
                worst = worst.max(d[b].abs() - shear);
            }
        }
    }
    worst
}

/// Smallest volume of a cell's corner, by positions in f64: over each element and each three of its neighbours.
///
/// Panics if one is smaller than limits kept to `residual` allow: at the paper's angles a corner may come to zero
/// with every limit met, and so below it by what the residual leaves.
pub(super) fn smallest_corner(model: &ChainMail, state: &TissueState, residual: f64) -> f64 {
    let lattice = model.lattice();
    let mut smallest = f64::INFINITY;
    for element in 0..model.element_count() as u32 {
        let x = state.position_m(model, element);
        let around = lattice.neighbours(element);
        for corner in 0..8 {
            let sides = [0, 1, 2].map(|axis| corner >> axis & 1);
            let [Some(a), Some(b), Some(c)] = [0, 1, 2].map(|axis| around[2 * axis + sides[axis]]) else {
                continue;
            };
            let mut tangents = [0.0; 3];
            let mut longest = 1.0;
            let links = [(a, 0), (b, 1), (c, 2)].map(|(neighbour, axis): (u32, usize)| {
                let link = model
                    .classes
                    .of_link(lattice.structure(element), lattice.structure(neighbour));
                let l = model.classes.limits(link.map_or(0, |(class, _)| class), axis);
                tangents[axis] = f64::from(l.tan) + residual / (1.0 + f64::from(l.low) - residual);
                longest *= 1.0 + f64::from(l.high) + residual;
                let y = state.position_m(model, neighbour);
                let sign = if sides[axis] == 1 { 1.0 } else { -1.0 };
                nalgebra::Vector3::from([0, 1, 2].map(|n| sign * (y[n] - x[n]) / lattice.spacing_m))
            });
            let volume = nalgebra::Matrix3::from_columns(&links).determinant();
            let [tx, ty, tz] = tangents;
            let beyond = tx * ty + ty * tz + tz * tx + 2.0 * tx * ty * tz - 1.0;
            assert!(
                volume >= -longest * beyond.max(0.0) - 1e-5,
                "corner {volume}, limits allow {beyond}"
            );
            smallest = smallest.min(volume);
        }
    }
    smallest
}

pub(super) struct Run {
    pub worst_solve: Solve,
    most_passes: u32,
    solves: [u32; 4],
    passes: u32,
    pub smallest_corner: f64,
}

/// Wanders for `ticks` ticks by up to `per_tick` elements, turning back now and then, and checks each step.
pub(super) fn wander(labels: &Labels, parameters: &TissueParameters, per_tick: f64, ticks: u32, seed: u64) -> Run {
    let model = model_with(labels, parameters);
    let mut state = TissueState::at_rest(&model);
    let mut random = Random(seed);
    let count = model.element_count() as f64;
    let mut element = (random.unit() * count) as u32;
    let (mut way, mut direction) = ([0.0; 3], [0.0; 3]);
    let mut run = Run {
        worst_solve: Solve::Nothing,
        most_passes: 0,
        solves: [0; 4],
        passes: 0,
        smallest_corner: f64::INFINITY,
    };
    for tick in 0..ticks {
        if tick % 50 == 0 {
            element = (random.unit() * count) as u32;
            way = state.deformed(&model).displacement(element);
        }
        if tick % 7 == 0 {
            direction = [(); 3].map(|()| random.signed() * per_tick);
        } else if tick % 11 == 0 {
            direction = direction.map(|c| -c);
        }
        way = [0, 1, 2].map(|a| (way[a] + direction[a]).clamp(-40.0, 40.0));
        let held = held_at(&model, element, way);
        let report = step(&model, &mut state, Some(held), 1e-3);
        assert!(report.converged, "tick {tick}: {report:?}");
        assert_eq!(report.held, HeldOutcome::Followed);
        let now = state.deformed(&model).displacement(element);
        assert!((0..3).all(|a| (now[a] - way[a]).abs() < 1e-5), "held element moved");
        let reference = largest_violation(&model, &state);
        let dishonest = "what was looked at is not all that is violated";
        assert!(
            (reference - report.residual).abs() < 2e-5,
            "tick {tick}: {reference}, {report:?}: {dishonest}"
        );
        if tick % 10 == 0 {
            let found = oracle_violation(&model, &state, parameters);
            assert!(found <= 1.001e-3, "tick {tick}: violation {found}, {report:?}");
            assert!((found - report.residual).abs() < 2e-5, "residual is not honest");
            run.smallest_corner = run
                .smallest_corner
                .min(smallest_corner(&model, &state, report.residual));
        }
        run.solves[report.solve as usize] += 1;
        run.passes += report.passes;
        run.worst_solve = run.worst_solve.max(report.solve);
        run.most_passes = run.most_passes.max(report.passes);
    }
    run
}

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
fn re_anchoring_reaches_the_limits_from_any_state_and_spares_other_parts() {
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
fn long_step_leaves_violations_after_one_pass_and_none_after_a_step() {
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
fn one_pass_of_the_queue_and_of_the_sweeps_gives_the_same_bits_on_a_block() {
    let model = model_of(&test_bodies::block([9, 8, 7]));
    let element = model.lattice().element_of_cell(4, 3, 2).expect("inside");
    let (mut by_queue, mut by_sweep) = (TissueState::at_rest(&model), TissueState::at_rest(&model));
    let way = [30.0, -25.0, 40.0];
    let moved = queue::QueuePass::new(&model).run(&model, &mut by_queue, held_at(&model, element, way));
    single_pass(&model, &mut by_sweep, held_at(&model, element, way));
    assert_eq!(moved as usize, model.element_count());
    for axis in 0..3 {
        assert_eq!(by_queue.displacement(axis), by_sweep.displacement(axis));
    }
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
fn body_left_alone_comes_to_rest_exactly_and_not_through_denormals() {
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
