//! Claims about the state: same bytes, no heap, scale, new limits.

use super::{held_at, model_of, paper, reference::Reference, violation::largest_violation};
use crate::limits::TissueParameters;
use crate::scene::test_bodies;
use crate::simd::Simd;
use crate::tissue::HeldOutcome;
use crate::tissue::chainmail::*;
use stylet_heap as heap;
use stylet_random::Random;

/// A random walk of one element after the other.
pub(super) struct Walk {
    random: Random,
    element: u32,
    way: [f64; 3],
}

impl Walk {
    pub fn new(seed: u64) -> Self {
        Walk {
            random: Random(seed),
            element: 0,
            way: [0.0; 3],
        }
    }

    pub fn next(&mut self, model: &ChainMail, state: &TissueState, tick: u32, per_tick: f64) -> Held {
        if tick.is_multiple_of(40) {
            self.element = (self.random.unit() * model.element_count() as f64) as u32;
            self.way = state.deformed(model).displacement(self.element);
        }
        for way in &mut self.way {
            *way = (*way + per_tick * self.random.signed()).clamp(-20.0, 20.0);
        }
        held_at(model, self.element, self.way)
    }
}

fn bits(state: &TissueState) -> Vec<u32> {
    let values = state.u.iter().flatten().map(|u| u.to_bits());
    values.chain([state.scale().to_bits()]).collect()
}

#[test]
fn vectors_and_portable_loops_give_the_same_bytes() {
    for labels in [
        test_bodies::block([19, 10, 9]),
        test_bodies::horseshoe(),
        test_bodies::speckle(3),
        test_bodies::layers(),
        test_bodies::bone(),
    ] {
        let vectors = model_of(&labels);
        let mut portable = vectors.clone();
        portable.simd = Simd::Portable;
        let mut states = [TissueState::at_rest(&vectors), TissueState::at_rest(&portable)];
        let mut walk = Walk::new(3);
        for tick in 0..400 {
            let held = walk.next(&vectors, &states[0], tick, 0.8);
            let a = step(&vectors, &mut states[0], Some(held), 5e-3);
            let b = step(&portable, &mut states[1], Some(held), 5e-3);
            assert_eq!(a, b, "tick {tick}");
            assert!(bits(&states[0]) == bits(&states[1]), "tick {tick}");
        }
    }
}

#[test]
fn steps_and_new_limits_do_not_touch_the_heap() {
    let wider = TissueParameters {
        max_stretch: 2.0,
        ..TissueParameters::default()
    };
    for labels in [test_bodies::with_hole(), test_bodies::bone()] {
        let scene = Scene::from_labels("test", &labels).expect("valid");
        let mut tissue = ChainMailTissue::new(&scene, TissueParameters::default().validate().expect("valid"));
        let limits = [TissueParameters::default(), wider.clone()].map(|p| p.validate().expect("valid"));
        let mut walk = Walk::new(1);
        let mut solves = [0; 4];
        let calls = heap::calls_of_this_thread();
        for tick in 0..600 {
            let mut held = walk.next(&tissue.model, &tissue.state, tick, 1.0);
            held.patch_m = if tick % 3 == 0 { 4e-3 } else { 0.0 };
            let report = tissue.step((tick % 50 < 40).then_some(held), 5e-3);
            solves[report.solve as usize] += 1;
            if tick % 100 == 0 {
                // A clone of limits without structures in it is flat.
                tissue.set_limits(limits[tick as usize / 100 % 2].clone());
            }
        }
        assert_eq!(heap::calls_of_this_thread(), calls);
        println!("solved by {solves:?}");
        assert!(solves[1] > 0 && solves[2] + solves[3] > 0, "not every way was taken");
    }
}

/// Such a state used to be followed out of its bounds.
#[test]
fn state_of_another_body_of_equal_size_is_refused() {
    let other = |labels| {
        let model = model_of(&labels);
        TissueState::at_rest(&model)
    };
    let upright = model_of(&test_bodies::block([2, 2, 3]));
    let mut flat = other(test_bodies::block([2, 3, 2]));
    let held = Some(held_at(&upright, 9, [0.5, 0.0, 0.0]));
    assert!(!step(&upright, &mut flat, held, 5e-3).converged);

    let bony = model_of(&test_bodies::bone());
    let mut soft_labels = test_bodies::bone();
    soft_labels.structures.clear();
    soft_labels
        .cells
        .iter_mut()
        .for_each(|label| *label = u8::from(*label != 0));
    let mut soft = other(soft_labels);
    let free = (0..bony.element_count() as u32)
        .find(|&e| !bony.is_fixed(e))
        .expect("tissue");
    let report = step(&bony, &mut soft, Some(held_at(&bony, free, [0.5, 0.0, 0.0])), 5e-3);
    assert!(!report.converged);
}

#[test]
fn recovery_follows_the_exponential_however_long_it_goes_on() {
    let model = model_of(&test_bodies::block([6, 6, 6]));
    let mut state = TissueState::at_rest(&model);
    step(&model, &mut state, Some(held_at(&model, 50, [0.2, 0.1, -0.3])), 0.0);
    let before = state.deformed(&model).displacement(50);
    // Across two renewals of the scale.
    for tick in 1..=5000 {
        step(&model, &mut state, None, 5e-3);
        if tick % 500 == 0 {
            let expected = (-5e-3 * f64::from(tick)).exp();
            let now = state.deformed(&model).displacement(50);
            for axis in 0..3 {
                let ratio = now[axis] / before[axis];
                assert!(
                    (ratio / expected - 1.0).abs() < 1e-5,
                    "tick {tick}: {ratio} for {expected}"
                );
            }
        }
    }
}

#[test]
fn tighter_limits_are_met_by_the_next_step_that_holds() {
    let scene = Scene::builtin("paper").expect("built in");
    let mut tissue = ChainMailTissue::new(&scene, TissueParameters::default().validate().expect("valid"));
    let element = scene.lattice.element_of_cell(53, 31, 80).expect("inside");
    let held = held_at(&tissue.model, element, [1.0, 2.0, 8.0]);
    tissue.step(Some(held), 5e-3);
    let tight = TissueParameters {
        min_stretch: 0.8,
        max_stretch: 1.2,
        shear_deg: 15.0,
        shear_vert_deg: 15.0,
        ..TissueParameters::default()
    };
    tissue.set_limits(tight.validate().expect("valid"));
    // With nothing held the violation is reported, not mended.
    let mut free = tissue.clone();
    let report = free.step(None, 0.0);
    assert!(!report.converged && report.residual > 0.1, "{report:?}");
    assert!((largest_violation(&free.model, &free.state) - report.residual).abs() < 1e-5);
    let report = tissue.step(Some(held), 0.0);
    assert!(report.converged && report.held == HeldOutcome::Followed);
    assert!(largest_violation(&tissue.model, &tissue.state) <= 1e-3);
}

#[test]
fn ten_thousand_cycles_in_the_gland_end_where_one_ends() {
    let model = paper();
    let element = model.lattice().element_of_cell(53, 31, 74).expect("inside");
    let mut state = TissueState::at_rest(&model);
    let cycle = |state: &mut TissueState| {
        // In by six elements and out again, at 5 ms a tick and 0.5 s a cycle; then ten seconds to recover.
        for way in [2.0, 4.0, 6.0, 4.0, 2.0, 0.0] {
            step(
                &model,
                state,
                Some(held_at(&model, element, [0.0, 0.3 * way, way])),
                0.08,
            );
        }
        step(&model, state, None, 10.0);
    };
    cycle(&mut state);
    let one: Vec<_> = (0..model.element_count() as u32)
        .map(|e| state.deformed(&model).displacement(e))
        .collect();
    (1..10_000).for_each(|_| cycle(&mut state));
    let mut drift = 0.0_f64;
    for (e, one) in one.iter().enumerate() {
        let now = state.deformed(&model).displacement(e as u32);
        drift = (0..3).fold(drift, |worst, axis| worst.max((now[axis] - one[axis]).abs()));
    }
    println!("largest drift {drift:.1e} elements");
    assert!(drift < 1e-3, "{drift}");
}

#[test]
fn f32_and_looking_only_at_what_moves_cost_next_to_nothing() {
    let model = model_of(&test_bodies::block([15, 13, 14]));
    let (mut state, mut reference) = (TissueState::at_rest(&model), Reference::at_rest(&model));
    let element = model.lattice().element_of_cell(7, 6, 2).expect("inside");
    let mut worst = 0.0_f64;
    for tick in 0..200 {
        let way = 0.06 * f64::from(if tick < 100 { tick } else { 200 - tick });
        let held = held_at(&model, element, [0.1 * way, -0.2 * way, way]);
        step(&model, &mut state, Some(held), 5e-3);
        assert!(reference.step(&model, held, 5e-3) <= 1e-3);
        for (e, expected) in reference.u.iter().enumerate() {
            let now = state.deformed(&model).displacement(e as u32);
            worst = (0..3).fold(worst, |w, axis| w.max((now[axis] - expected[axis]).abs()));
        }
    }
    println!("{worst:.1e} elements from f64");
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn step_that_moves_nothing_reports_the_same_again() {
    let model = paper();
    let element = model.lattice().element_of_cell(53, 31, 80).expect("inside");
    let mut state = TissueState::at_rest(&model);
    let held = held_at(&model, element, [1.0, -2.0, 6.0]);
    let first = step(&model, &mut state, Some(held), 0.0);
    let before = bits(&state);
    let again = step(&model, &mut state, Some(held), 0.0);
    assert_eq!((again.moved, again.passes), (0, 0));
    assert_eq!(again.max_displacement, first.max_displacement);
    assert!(bits(&state) == before);
}
