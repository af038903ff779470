//! Claims about structures: their own limits, fixed ones, and patches of held elements.

use super::state::Walk;
use super::{held_at, model_of, model_with, smallest_corner, violation::largest_violation};
use crate::limits::{AxisLimits, TissueParameters, folding};
use crate::scene::test_bodies;
use crate::tissue::HeldOutcome;
use crate::tissue::chainmail::*;
use stylet_random::Random;

fn positions(model: &ChainMail, state: &TissueState) -> Vec<[f64; 3]> {
    let elements = 0..model.element_count() as u32;
    elements.map(|e| state.deformed(model).position_m(e)).collect()
}

/// Returns the largest violation by positions in f64, with the rule for structures written out again.
fn oracle_violation(scene: &Scene, model: &ChainMail, state: &TissueState, own: &TissueParameters) -> f64 {
    let x = positions(model, state);
    let operator = [own.shear_deg, own.shear_vert_deg, own.shear_vert_deg].map(|shear_deg| AxisLimits {
        min_stretch: own.min_stretch,
        max_stretch: own.max_stretch,
        shear_deg,
    });
    let material = |e: u32| &scene.structures[scene.lattice.structure(e) as usize].material;
    let mut worst = 0.0_f64;
    for e in 0..model.element_count() as u32 {
        for axis in 0..3 {
            let Some(n) = scene.lattice.neighbours(e)[2 * axis + 1] else {
                continue;
            };
            if material(e).fixed && material(n).fixed {
                continue;
            }
            let has_say = [e, n].into_iter().filter(|&m| !material(m).fixed);
            let limits: Vec<_> = has_say.map(|m| material(m).limits.unwrap_or(operator)[axis]).collect();
            let d = [0, 1, 2].map(|a| (x[n as usize][a] - x[e as usize][a]) / scene.lattice.spacing_m);
            for l in limits {
                let side = (0..3).filter(|&a| a != axis).map(|a| d[a].abs()).fold(0.0, f64::max);
                let shear = side - l.shear_deg.to_radians().tan() * d[axis];
                worst = worst
                    .max(l.min_stretch - d[axis])
                    .max(d[axis] - l.max_stretch)
                    .max(shear);
            }
        }
    }
    worst
}

/// Walks about and holds every step to the oracles; returns the outcomes followed and limited.
fn walk_about(labels: &crate::scene::Labels, per_tick: f64, seed: u64) -> [u32; 2] {
    let scene = Scene::from_labels("test", labels).expect("valid labels");
    let parameters = TissueParameters::default();
    let model = ChainMail::new(&scene, parameters.validate().expect("valid"));
    let mut state = TissueState::at_rest(&model);
    let mut walk = Walk::new(seed);
    let (mut outcomes, mut smallest, mut solves) = ([0; 2], f64::INFINITY, [0; 4]);
    for tick in 0..400 {
        let held = walk.next(&model, &state, tick, per_tick);
        let report = step(&model, &mut state, Some(held), 5e-3);
        assert!(report.converged, "tick {tick}: {report:?}");
        solves[report.solve as usize] += 1;
        assert!(
            (largest_violation(&model, &state) - report.residual).abs() < 2e-5,
            "tick {tick}: {report:?}"
        );
        outcomes[usize::from(report.held == HeldOutcome::Limited)] += 1;
        if report.held == HeldOutcome::Followed {
            let now = state.deformed(&model).position_m(held.element);
            assert!(
                (0..3).all(|a| (now[a] - held.position_m[a]).abs() < 1e-8),
                "tick {tick}: not followed"
            );
        }
        if tick % 10 == 0 {
            let found = oracle_violation(&scene, &model, &state, &parameters);
            assert!(found <= 1.001e-3, "tick {tick}: {found}, {report:?}");
            smallest = smallest.min(smallest_corner(&model, &state, report.residual));
        }
        let fixed = (0..model.element_count() as u32).filter(|&e| model.is_fixed(e));
        assert!(
            fixed
                .into_iter()
                .all(|e| state.deformed(&model).displacement(e) == [0.0; 3]),
            "bone moved"
        );
    }
    println!("followed and limited {outcomes:?}, solved by {solves:?}, smallest corner {smallest:.3}");
    outcomes
}

#[test]
fn each_structure_keeps_its_own_limits_per_axis() {
    assert_eq!(walk_about(&test_bodies::layers(), 0.3, 2)[1], 0);
}

#[test]
fn contrast_of_one_to_a_thousand_is_solved() {
    let mut labels = test_bodies::layers();
    labels.structures[1].material.limits = Some(
        [AxisLimits {
            min_stretch: 1.0 - 4.5e-4,
            max_stretch: 1.0 + 7.5e-4,
            shear_deg: 0.0286,
        }; 3],
    );
    assert_eq!(walk_about(&labels, 0.2, 3)[1], 0);
}

#[test]
fn random_limits_that_meet_equation_1_fold_no_cell() {
    let mut random = Random(17);
    let mut drawn = 0;
    while drawn < 12 {
        let axes = [(); 3].map(|()| AxisLimits {
            min_stretch: 0.2 + 0.8 * random.unit(),
            max_stretch: 1.0 + 2.0 * random.unit(),
            shear_deg: 55.0 * random.unit(),
        });
        if folding(axes.map(|axis| axis.shear_deg)) > 1.0 {
            continue;
        }
        drawn += 1;
        let mut labels = test_bodies::layers();
        labels.structures[1].material.limits = Some(axes);
        walk_about(&labels, 0.5, drawn);
    }
}

#[test]
fn bone_never_moves_and_reports_a_limited_needle() {
    let [followed, limited] = walk_about(&test_bodies::bone(), 0.4, 5);
    assert!(followed > 50 && limited > 10, "{followed} followed, {limited} limited");
}

#[test]
fn element_pulled_from_bone_goes_as_far_as_the_links_reach() {
    // A line of nine links from bone, each at most 1.75 long: 6.75 elements, and the needle asks for more.
    let mut labels = test_bodies::bone();
    labels.dims = [10, 1, 1];
    labels.cells = [2, 1, 1, 1, 1, 1, 1, 1, 1, 1].to_vec();
    let model = model_with(&labels, &TissueParameters::default());
    let mut state = TissueState::at_rest(&model);
    for (asked, outcome) in [
        (6.7, HeldOutcome::Followed),
        (6.8, HeldOutcome::Limited),
        (1000.0, HeldOutcome::Limited),
        (-4.0, HeldOutcome::Followed),
        (-4.2, HeldOutcome::Limited),
    ] {
        state.return_to_rest(&model);
        let report = step(&model, &mut state, Some(held_at(&model, 9, [asked, 0.0, 0.0])), 0.0);
        let reached = state.deformed(&model).displacement(9)[0];
        println!("asked {asked}, reached {reached}, {report:?}");
        assert_eq!(report.held, outcome, "{asked}");
        assert!(report.converged && (-4.06..=6.76).contains(&reached));
        // Asked again and again it comes to the last place that the links allow.
        for _ in 0..20 {
            step(&model, &mut state, Some(held_at(&model, 9, [asked, 0.0, 0.0])), 0.0);
        }
        let farthest = asked.clamp(-4.05, 6.75);
        let reached = state.deformed(&model).displacement(9)[0];
        assert!((reached - farthest).abs() < 0.07, "asked {asked}, reached {reached}");
    }
    let bone = step(&model, &mut state, Some(held_at(&model, 0, [1.0, 0.0, 0.0])), 0.0);
    assert_eq!(bone.held, HeldOutcome::Limited);
}

#[test]
fn patch_of_held_elements_moves_as_one() {
    for labels in [
        test_bodies::block([12, 11, 10]),
        test_bodies::with_hole(),
        test_bodies::speckle(3),
    ] {
        let model = model_of(&labels);
        let lattice = model.lattice();
        let mut state = TissueState::at_rest(&model);
        let element = (0..model.element_count() as u32)
            .find(|&e| lattice.cell(e).iter().zip(lattice.dims).all(|(&c, n)| c >= n / 3))
            .expect("an element inside");
        for tick in 1..60 {
            let way = 0.15 * f64::from(tick);
            let mut held = held_at(&model, element, [way, -0.5 * way, 0.3 * way]);
            // Two elements to each side, and the edge falls on centres.
            held.patch_m = 4.0 * lattice.spacing_m;
            let report = step(&model, &mut state, Some(held), 5e-3);
            assert!(
                report.converged && largest_violation(&model, &state) <= 1.001e-3,
                "tick {tick}: {report:?}"
            );
            let body = state.deformed(&model);
            let centre = body.displacement(element);
            let mut count = 0;
            for e in 0..model.element_count() as u32 {
                let (a, b) = (lattice.cell(e), lattice.cell(element));
                if model.part(e) == model.part(element) && (0..3).all(|n| a[n].abs_diff(b[n]) <= 2) {
                    assert_eq!(body.displacement(e), centre, "tick {tick}");
                    count += 1;
                }
            }
            assert!(count > 40);
        }
    }
}

#[test]
fn patch_of_a_bad_size_is_refused() {
    let model = model_of(&test_bodies::block([4, 4, 4]));
    let mut state = TissueState::at_rest(&model);
    for patch_m in [f64::NAN, -1e-3, f64::INFINITY] {
        let held = Held {
            patch_m,
            ..held_at(&model, 9, [1.0, 0.0, 0.0])
        };
        let report = step(&model, &mut state, Some(held), 1e-3);
        assert_eq!(report.held, HeldOutcome::Refused);
    }
}
