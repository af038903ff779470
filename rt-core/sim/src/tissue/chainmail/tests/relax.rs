//! Claims about relaxation: where it ends, when it ends, and what it costs the limits.

use super::state::Walk;
use super::{held_at, model_of, model_with, smallest_corner};
use crate::limits::Relaxation;
use crate::limits::TissueParameters;
use crate::scene::{Labels, test_bodies};
use crate::tissue::chainmail::*;
use crate::tissue::{HeldOutcome, largest_violation};

/// Limits that a small displacement does not reach, and no recovery but by relaxation.
fn elastic() -> TissueParameters {
    TissueParameters {
        min_stretch: 0.01,
        max_stretch: 100.0,
        recovery_time_s: f64::INFINITY,
        relaxation_iterations: 10,
        relaxation_weight: 1.7,
        shear_to_axial: 0.25,
        foundation_to_axial: 0.02,
        ..TissueParameters::default()
    }
}

/// Returns one component at equilibrium with some elements held, by a dense solver over springs written out one by one.
fn equilibrium(scene: &Scene, p: &TissueParameters, component: usize, held: impl Fn(u32) -> Option<f64>) -> Vec<f64> {
    let n = scene.lattice.element_count();
    let (mut a, mut b) = (
        nalgebra::DMatrix::<f64>::zeros(n, n),
        nalgebra::DVector::<f64>::zeros(n),
    );
    let material = |e: u32| &scene.structures[scene.lattice.structure(e) as usize].material;
    let reference = scene
        .structures
        .iter()
        .find(|s| !s.material.fixed)
        .expect("tissue")
        .material
        .young_pa;
    for e in 0..n as u32 {
        let row = e as usize;
        if let Some(value) = held(e).or(material(e).fixed.then_some(0.0)) {
            (a[(row, row)], b[row]) = (1.0, value);
            continue;
        }
        a[(row, row)] = p.foundation_to_axial;
        for (direction, neighbour) in scene.lattice.neighbours(e).into_iter().enumerate() {
            let Some(other) = neighbour else { continue };
            let stiffness = if direction / 2 == component {
                1.0
            } else {
                p.shear_to_axial
            };
            let mean = if material(other).fixed {
                material(e).young_pa
            } else {
                2.0 / (1.0 / material(e).young_pa + 1.0 / material(other).young_pa)
            };
            a[(row, row)] += stiffness * mean / reference;
            a[(row, other as usize)] -= stiffness * mean / reference;
        }
    }
    a.lu().solve(&b).expect("regular").as_slice().to_vec()
}

#[test]
fn body_held_still_comes_to_the_equilibrium_of_its_springs() {
    let mut stiff_layer = test_bodies::layers();
    for structure in &mut stiff_layer.structures {
        structure.material.limits = None;
    }
    stiff_layer.structures[1].material.young_pa = 5.0 * 17e3;
    let cases: [(&str, Labels); 4] = [
        ("block", test_bodies::block([9, 7, 6])),
        ("hole", test_bodies::with_hole()),
        ("stiff layer", stiff_layer),
        ("bone", test_bodies::bone()),
    ];
    // The stiff layer rests on a soft foundation: its slowest mode needs tens of thousands of passes.
    let p = TissueParameters {
        relaxation_iterations: 200,
        ..elastic()
    };
    for (name, labels) in cases {
        let scene = Scene::from_labels("test", &labels).expect("valid");
        let model = model_with(&labels, &p);
        let element = (model.element_count() / 2) as u32;
        assert!(!model.is_fixed(element));
        let mut state = TissueState::at_rest(&model);
        let way = [0.2, -0.1, 0.3];
        for _ in 0..300 {
            let report = step(&model, &mut state, Some(held_at(&model, element, way)), 5e-3);
            assert!(report.converged && report.held == HeldOutcome::Followed);
        }
        let mut worst = 0.0_f64;
        for (component, way) in way.into_iter().enumerate() {
            let at_rest = equilibrium(&scene, &p, component, |e| (e == element).then_some(way));
            for (e, expected) in at_rest.iter().enumerate() {
                let now = state.deformed(&model).displacement(e as u32)[component];
                worst = worst.max((now - expected).abs());
            }
        }
        println!("{name}: {worst:.1e} elements from the dense solve");
        assert!(worst < 1e-5, "{name}: {worst}");
    }
}

/// Returns the energy-like size of a body's displacement after passes with an unchecked weight, from a rough start.
fn size_after(weight: f32, passes: u32) -> f32 {
    let mut model = model_of(&test_bodies::block([24, 12, 12]));
    let mut limits = elastic().validate().expect("valid");
    let relaxation = Relaxation {
        iterations: 1,
        weight,
        shear: 0.25,
        foundation: 0.0,
    };
    limits.relaxation = Some(relaxation);
    model.set_limits(limits);
    let mut state = TissueState::at_rest(&model);
    let mut random = stylet_random::Random(4);
    for e in 0..model.element_count() {
        // Along x every other element the other way: the fastest mode of a row.
        let sign = if e % 2 == 0 { 1.0 } else { -1.0 };
        state.put(e, [sign + 0.1 * random.signed() as f32, 0.0, 0.0]);
    }
    let size = |state: &TissueState| {
        let values = state.displacement(0);
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        values.iter().map(|u| (u - mean).abs()).fold(0.0, f32::max)
    };
    let before = size(&state);
    for pass in 0..2 * passes {
        relax::half_pass::<kernels::Portable>(&model, &mut state, None, &relaxation, pass as usize % 2);
    }
    size(&state) / before
}

#[test]
fn relaxation_decays_up_to_its_bound_and_grows_beyond_it() {
    let [inside, at, beyond] = [1.9, 2.0, 2.1].map(|weight| size_after(weight, 400));
    println!("after 400 passes: {inside:.2e} with weight 1.9, {at:.2e} with 2, {beyond:.2e} with 2.1");
    assert!(inside < 0.1 && at < 1.0 && beyond > 1e3);
}

#[test]
fn relaxed_body_keeps_its_limits_and_reports_them_honestly() {
    let parameters = TissueParameters {
        relaxation_iterations: 5,
        ..TissueParameters::default()
    };
    for labels in [
        test_bodies::block([14, 12, 10]),
        test_bodies::with_hole(),
        test_bodies::horseshoe(),
        test_bodies::layers(),
        test_bodies::bone(),
    ] {
        let model = model_with(&labels, &parameters);
        let mut state = TissueState::at_rest(&model);
        let mut walk = Walk::new(6);
        let (mut most_passes, mut solves, mut smallest) = (0, [0; 4], f64::INFINITY);
        for tick in 0..400 {
            let held = walk.next(&model, &state, tick, 0.3);
            let report = step(&model, &mut state, Some(held), 5e-3);
            assert!(report.converged, "tick {tick}: {report:?}");
            let reference = largest_violation(&model, &state);
            assert!(
                (reference - report.residual).abs() < 2e-5,
                "tick {tick}: {reference}, {report:?}"
            );
            most_passes = most_passes.max(report.passes);
            solves[report.solve as usize] += 1;
            if tick % 10 == 0 {
                smallest = smallest.min(smallest_corner(&model, &state, report.residual));
            }
        }
        println!("at most {most_passes} passes, solved by {solves:?}, smallest corner {smallest:.3}");
    }
}

#[test]
fn relaxation_alone_brings_a_body_home_and_to_exact_rest() {
    let p = TissueParameters {
        foundation_to_axial: 0.5,
        ..elastic()
    };
    let model = model_with(&test_bodies::with_hole(), &p);
    let mut state = TissueState::at_rest(&model);
    step(&model, &mut state, Some(held_at(&model, 200, [2.0, 1.0, -1.0])), 5e-3);
    for _ in 0..400 {
        step(&model, &mut state, None, 5e-3);
        assert!(!state.u.iter().flatten().any(|u| u.is_subnormal()));
    }
    assert_eq!(state.max_displacement, 0.0);
}
