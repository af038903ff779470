use super::*;
use crate::scene::Scene;
use crate::tissue::TissueModel;
use crate::tissue::fem::{FemModel, FemTissue};

fn paper() -> (Scene, BatchModel<f32>, FemModel<f32>) {
    let scene = Scene::builtin("paper").unwrap();
    let tissue = FemTissue::<f32>::new(&scene).unwrap();
    (scene, BatchModel::new(&tissue.model), tissue.model)
}

/// A line through the middle of the gland, along its axis.
fn ready(scene: &Scene, body: &BatchModel<f32>) -> ReadyLine {
    let (low, high) = scene.lattice.bounds_m();
    let start_m = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2] - 0.01];
    let line = Line::into_body(&scene.lattice, start_m, [0.0, 0.0, 1.0]).unwrap();
    ReadyLine::prepare(1, body, &scene.lattice, &|_| LayerKind::Gland, line, &mut |_| true).unwrap()
}

#[test]
fn a_line_enters_the_body_where_its_first_element_is() {
    let scene = Scene::builtin("paper").unwrap();
    let element = scene.lattice.element_of_cell(53, 31, 80).unwrap();
    let inside_m = scene.lattice.rest_m(element);
    let line = Line::into_body(&scene.lattice, inside_m, [0.0, 0.0, 1.0]).unwrap();
    let just = |along_m: f64| {
        let cell = line
            .point_m(along_m, [0.0; 2])
            .map(|c| (c / scene.lattice.spacing_m) as usize);
        scene.lattice.element_of_cell(cell[0], cell[1], cell[2]).is_some()
    };
    assert!(just(1e-6) && !just(-1e-6), "{line:?}");
    assert!(Line::into_body(&scene.lattice, [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]).is_none());
}

#[test]
fn a_needle_beside_the_line_or_across_it_is_not_on_it() {
    let line = Line::new([0.01, 0.02, 0.03], [0.0, 0.0, 1.0]).unwrap();
    let met = |tip: [f64; 3], direction: [f64; 3]| {
        line.is_met_by(&tip.into(), &Vector3::from(direction).normalize(), BESIDE_M, TILT_RAD)
    };
    assert!(met([0.01, 0.02, -0.05], [0.0, 0.0, 1.0]));
    assert!(met([0.0105, 0.02, 0.0], [0.0, 0.0, 1.0]));
    assert!(!met([0.012, 0.02, 0.0], [0.0, 0.0, 1.0]), "2 mm beside");
    assert!(!met([0.01, 0.02, 0.0], [0.05, 0.0, 1.0]), "3 degrees");
    assert!(!met([0.01, 0.02, 0.0], [0.0, 0.0, -1.0]), "the other way");
}

/// The tissue of the loop is where the needle has it: the element at the tip, moved by the columns, is at the tip.
#[test]
fn the_body_follows_the_loads_of_the_line_and_is_at_rest_without_them() {
    let (scene, body, _) = paper();
    let ReadyLine {
        mut hand,
        body: columns,
    } = ready(&scene, &body);
    let mut tissue = FemTissue::<f32>::new(&scene).unwrap();
    let mut tip_m = 0.0;
    while tip_m < 5e-3 {
        tip_m += 5e-5;
        let answer = hand.step(tip_m, 1e-3);
        assert!(answer.punctured.is_none(), "5 of 8 mm");
    }
    let report = tissue.displace(&columns.columns, hand.state().loads_n()).unwrap();
    assert!(report.converged && report.moved > 19_000, "{report:?}");
    // The tip presses as a patch: at its middle the lattice moves a little more than on the mean over the patch.
    let at_entry = hand
        .line()
        .point_m(5e-4, [0.0; 2])
        .map(|c| (c / scene.lattice.spacing_m) as usize);
    let element = scene
        .lattice
        .element_of_cell(at_entry[0], at_entry[1], at_entry[2])
        .unwrap();
    let moved_m = tissue.deformed().position_m(element)[2] - scene.lattice.rest_m(element)[2];
    assert!((4.5e-3..6.5e-3).contains(&moved_m), "{moved_m} m for 5 mm");
    while tip_m > -1e-3 {
        tip_m -= 5e-5;
        hand.step(tip_m, 1e-3);
    }
    assert!(!hand.is_in_tissue());
    let report = tissue.displace(&columns.columns, hand.state().loads_n()).unwrap();
    assert_eq!((report.moved, report.max_displacement), (0, 0.0));
}

#[test]
fn a_line_that_was_reset_or_has_taken_new_forces_answers_like_a_new_one() {
    let (scene, body, _) = paper();
    let mut hand = ready(&scene, &body).hand;
    let new = hand.clone();
    let forces = LayerForces {
        membrane_gain: 0.5,
        ..LayerForces::default()
    };
    hand.set_forces(&forces);
    for n in 0..400 {
        hand.step(5e-5 * f64::from(n), 1e-3);
    }
    assert!(hand.is_in_tissue());
    hand.reset();
    hand.set_forces(&LayerForces::default());
    let mut new = new;
    for n in 0..400 {
        let (a, b) = (
            hand.step(5e-5 * f64::from(n), 1e-3),
            new.step(5e-5 * f64::from(n), 1e-3),
        );
        assert_eq!(a, b);
    }
}
