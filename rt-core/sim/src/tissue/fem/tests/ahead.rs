//! Claims about work ahead: it answers what the converged solution is, and a wrong guess changes nothing.

use super::*;
use crate::tissue::fem::tissue::LIVE_CYCLES;
use crate::tissue::{Held, TissueModel};
use stylet_heap as heap;

const LIVE: SolveSettings = SolveSettings {
    relative_tolerance: 1e-3,
    max_cycles: LIVE_CYCLES,
};

fn patch(lattice: &Lattice, element: u32, by_m: [f64; 3]) -> Held {
    let rest = lattice.rest_m(element);
    Held {
        element,
        position_m: [0, 1, 2].map(|a| rest[a] + by_m[a]),
        patch_m: 4e-3,
    }
}

fn hard_body() -> FemModel<f64> {
    let lattice = lattice_of(&test_bodies::with_hole());
    FemModel::new(&lattice, &two_materials(&lattice, 5.0, 1e5)).expect("valid")
}

/// Returns two neighbouring patches in the body with a hole, pushed the same way.
fn two_patches(model: &FemModel<f64>) -> [Held; 2] {
    let lattice = model.lattice();
    let [i, j, k] = lattice.cell(300);
    let beside = lattice.element_of_cell(i, j, k + 1).expect("inside");
    [
        patch(lattice, 300, [1e-4, 0.0, 1e-3]),
        patch(lattice, beside, [1e-4, 1e-5, 1.1e-3]),
    ]
}

fn assert_is_converged_answer(model: &FemModel<f64>, state: &FemState<f64>, held: Held, report: &FemReport) {
    let mut fresh = FemState::at_rest(model);
    let cold = step(model, &mut fresh, Some(held), &EXACT);
    assert!(cold.converged && report.converged, "{report:?}");
    for axis in 0..3 {
        let off_n = (cold.tip_force_n[axis] - report.tip_force_n[axis]).abs();
        assert!(off_n < 1e-6 * cold.tip_force_n[2].abs(), "{cold:?} {report:?}");
        for (a, b) in state.displacement(axis).iter().zip(fresh.displacement(axis)) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
    }
}

/// However far the work ahead has come, and however well its direction was guessed; only when it is done is the step
/// free.
#[test]
fn prepared_patch_answers_as_the_converged_solution() {
    let model = hard_body();
    let [first, second] = two_patches(&model);
    let guesses = [second.position_m, [1e-3, 0.0, 0.0], [4e-4, 0.0, 1e-3]];
    for (guess, position_m) in guesses.into_iter().enumerate() {
        let rest = model.lattice().rest_m(second.element);
        let position_m = if guess == 0 {
            position_m
        } else {
            [0, 1, 2].map(|a| rest[a] + position_m[a])
        };
        for ticks in [1, 2, 3, 5, 200] {
            let mut state = FemState::at_rest(&model);
            for _ in 0..ticks + 1 {
                step(&model, &mut state, Some(first), &EXACT);
                prepare(&model, &mut state, Some(Held { position_m, ..second }), &EXACT);
            }
            let report = step(&model, &mut state, Some(second), &EXACT);
            println!("guess {guess}, {ticks} ticks ahead: {} cycles", report.cycles);
            assert_eq!(report.cycles == 0, guess == 0 && ticks == 200);
            assert_is_converged_answer(&model, &state, second, &report);
            // The patch before is still known.
            let back = step(&model, &mut state, Some(first), &EXACT);
            assert_eq!(back.cycles, 0);
            assert_is_converged_answer(&model, &state, first, &back);
        }
    }
}

#[test]
fn first_contact_is_prepared_while_nothing_is_held() {
    let model = hard_body();
    let [_, met] = two_patches(&model);
    let mut state = FemState::at_rest(&model);
    for _ in 0..200 {
        let report = step(&model, &mut state, None, &EXACT);
        prepare(&model, &mut state, Some(met), &EXACT);
        assert!(report.converged && report.moved == 0 && report.tip_force_n == [0.0; 3]);
    }
    let report = step(&model, &mut state, Some(met), &EXACT);
    assert_eq!(report.cycles, 0);
    assert_is_converged_answer(&model, &state, met, &report);
}

/// Returns the displacements and reports, bit by bit, of a straight insertion into the paper's gland with these
/// guesses.
fn insertion(guess: impl Fn(usize) -> Option<[usize; 3]>) -> Vec<u64> {
    let scene = Scene::builtin("paper").expect("built in");
    let lattice = &scene.lattice;
    let model = FemModel::<f32>::new(lattice, &FemSettings::homogeneous(material(0.45, MEAN), 3e5)).expect("valid");
    let mut state = FemState::at_rest(&model);
    let mut bits = Vec::new();
    for tick in 0..30 {
        let by_m = [0.0, 0.0, 1e-3 + 1e-5 * tick as f64];
        let element = |[i, j, k]: [usize; 3]| lattice.element_of_cell(i, j, k).expect("inside");
        let held = (tick > 5 && tick != 20).then(|| patch(lattice, element([53, 31, 76 + tick / 6]), by_m));
        let next = guess(tick).map(|cell| patch(lattice, element(cell), by_m));
        let before = heap::calls_of_this_thread();
        let report = step(&model, &mut state, held, &LIVE);
        prepare(&model, &mut state, next, &LIVE);
        assert_eq!(heap::calls_of_this_thread(), before);
        let numbers = [report.relative_residual, report.tip_force_n[0], report.tip_force_n[2]];
        bits.extend(numbers.map(f64::to_bits));
        bits.extend(
            (0..3)
                .flat_map(|a| state.displacement(a))
                .map(|u| u64::from(u.to_bits())),
        );
    }
    bits
}

/// The tip does not come back to the patch before, which is still known unless work ahead took its place.
#[test]
fn wrong_guess_changes_no_bit() {
    let without = insertion(|_| None);
    for aside in [[50, 31, 79], [53, 33, 84]] {
        assert!(insertion(|_| Some(aside)) == without);
        assert!(insertion(|tick| Some([aside[0], aside[1], 78 + tick % 3])) == without);
    }
}

#[test]
fn work_ahead_makes_no_heap_calls_and_gives_the_same_bytes() {
    let run = || insertion(|tick| Some([53, 31, 77 + tick / 6]));
    let (first, second) = (run(), run());
    assert!(first == second);
    assert!(first != insertion(|_| None), "work ahead is used");
}

#[test]
fn a_step_prepares_one_piece_only_without_cycles() {
    let model = hard_body();
    let [first, second] = two_patches(&model);
    let mut state = FemState::at_rest(&model);
    let begun = |state: &FemState<f64>| state.next.cells.is_some();
    prepare(&model, &mut state, Some(second), &LIVE);
    assert!(!begun(&state), "before any step");
    assert!(step(&model, &mut state, Some(first), &LIVE).cycles > 0);
    prepare(&model, &mut state, Some(second), &LIVE);
    assert!(!begun(&state), "the step took cycles");
    while step(&model, &mut state, Some(first), &LIVE).cycles > 0 {}
    prepare(&model, &mut state, Some(second), &LIVE);
    let left = state.next.responses[0].residual;
    assert!(left.is_finite(), "taken up, and a cycle");
    prepare(&model, &mut state, Some(second), &LIVE);
    assert_eq!(state.next.responses[0].residual, left, "one piece a step");
    step(&model, &mut state, Some(first), &LIVE);
    prepare(&model, &mut state, Some(second), &LIVE);
    assert!(state.next.responses[0].residual < left);
}

#[test]
fn prepared_work_is_dropped_on_leaving_and_on_reset() {
    let model = hard_body();
    let [first, second] = two_patches(&model);
    let run = |ahead: bool| {
        let mut state = FemState::at_rest(&model);
        for _ in 0..200 {
            step(&model, &mut state, Some(first), &EXACT);
            prepare(&model, &mut state, Some(second).filter(|_| ahead), &EXACT);
        }
        step(&model, &mut state, None, &EXACT);
        let report = step(&model, &mut state, Some(second), &EXACT);
        assert!(report.cycles > 0);
        (report, state.displacement.clone())
    };
    assert!(run(true) == run(false));

    let scene = Scene::builtin("paper").expect("built in");
    let element = scene.lattice.element_of_cell(53, 31, 80).expect("inside");
    let rest = scene.lattice.rest_m(element);
    let held = Some(Held {
        element,
        position_m: [rest[0], rest[1], rest[2] + 1e-3],
        patch_m: 4e-3,
    });
    let mut tissue = FemTissue::<f32>::new(&scene).expect("valid");
    let mut contact = |ahead: Option<Held>| {
        for _ in 0..3 {
            tissue.step(None, 5e-3);
            tissue.prepare(ahead);
        }
        tissue.return_to_rest();
        tissue.step(held, 5e-3)
    };
    let fresh = contact(None);
    assert!(contact(held) == fresh && contact(None) == fresh);
}

/// Nothing that is asked for can be prepared: all stays as it was, and what comes after too.
#[test]
fn guess_that_cannot_be_held_is_passed_over() {
    let model = hard_body();
    let [first, second] = two_patches(&model);
    let other = FemModel::<f64>::new(
        &block([5; 3], 1.5e-3),
        &FemSettings::homogeneous(Material::PROSTATE, 1e5),
    );
    let other = other.expect("valid");
    let bad = [
        Held {
            element: u32::MAX,
            ..second
        },
        Held {
            patch_m: f64::NAN,
            ..second
        },
        Held {
            position_m: [f64::NAN; 3],
            ..second
        },
        Held {
            position_m: [0.0, 0.0, 10.0],
            ..second
        },
        Held {
            position_m: model.lattice().rest_m(second.element),
            ..second
        },
    ];
    let run = |guesses: &[Option<Held>]| {
        let mut state = FemState::at_rest(&model);
        for &guess in guesses {
            step(&model, &mut state, Some(first), &EXACT);
            prepare(&other, &mut state, Some(patch(other.lattice(), 62, [1e-3; 3])), &EXACT);
            prepare(&model, &mut state, guess, &EXACT);
            assert!(state.next.cells.is_none());
        }
        let report = step(&model, &mut state, Some(second), &EXACT);
        (report, state.displacement.clone())
    };
    assert!(run(&bad.map(Some)) == run(&[None; 5]));
}

/// The bar: what a live tick has, work ahead along the needle, within 1 % of the converged solution in every tick.
#[test]
fn live_insertion_with_work_ahead_stays_within_one_percent() {
    let scene = Scene::builtin("paper").expect("built in");
    let lattice = &scene.lattice;
    for poisson_ratio in [0.45, 0.49] {
        let elastic = FemSettings::homogeneous(material(poisson_ratio, MEAN), 3e5);
        let live = FemModel::<f32>::new(lattice, &elastic).expect("valid");
        let exact = FemModel::<f64>::new(lattice, &elastic).expect("valid");
        let (mut state, mut solved) = (FemState::at_rest(&live), FemState::at_rest(&exact));
        let (mut by_m, mut worst, mut with_cycles) = (0.0, 0.0_f64, 0);
        for tick in -9..=120 {
            // 50 mm/s at 200 Hz; past 8 mm the tissue follows by half, and the tip passes on to the next element.
            let tip_m = 0.25e-3 * f64::from(tick);
            let at = |k: usize, by_m: f64| {
                let element = lattice.element_of_cell(53, 31, k).expect("in the gland");
                patch(lattice, element, [0.0, 0.1 * by_m, by_m])
            };
            if tick <= 0 {
                step(&live, &mut state, None, &LIVE);
                prepare(&live, &mut state, Some(at(72, 0.25e-3)), &LIVE);
                continue;
            }
            by_m += if tip_m <= 8e-3 { 0.25e-3 } else { 0.125e-3 };
            let k = 72 + ((tip_m - by_m) / lattice.spacing_m) as usize;
            let held = at(k, by_m);
            let report = step(&live, &mut state, Some(held), &LIVE);
            prepare(&live, &mut state, Some(at(k + 1, by_m)), &LIVE);
            with_cycles += u32::from(report.cycles > 0);
            assert!(step(&exact, &mut solved, Some(held), &EXACT).converged);
            let squares = (0..3).flat_map(|a| state.displacement(a).iter().zip(solved.displacement(a)));
            let sum: f64 = squares.map(|(a, b)| f64::from(a - b).powi(2)).sum();
            let rms_m = (sum / lattice.element_count() as f64).sqrt() * lattice.spacing_m;
            worst = worst.max(rms_m / by_m);
        }
        println!(
            "nu {poisson_ratio}: worst tick {:.3} % of travel, {with_cycles} with cycles",
            100.0 * worst
        );
        assert!(worst < 0.01, "{worst}");
    }
}
