//! Claims about material points, in a deformed body.

use super::*;
use crate::limits::TissueParameters;
use crate::scene::{Scene, test_bodies};
use crate::tissue::{ChainMail, Held, TissueState, step};
use stylet_random::Random;

fn model_of(scene: &Scene) -> ChainMail {
    let limits = TissueParameters::default().validate().expect("valid");
    ChainMail::new(scene, limits)
}

/// Returns the paper's body with an element in its middle pushed aside by up to eight elements.
fn deformed() -> (Scene, ChainMail, TissueState) {
    let scene = Scene::builtin("paper").expect("built in");
    let model = model_of(&scene);
    let mut state = TissueState::at_rest(&model);
    let element = scene.lattice.element_of_cell(53, 31, 82).expect("inside");
    let rest = scene.lattice.rest_m(element);
    let h = scene.lattice.spacing_m;
    for tick in 1..=80 {
        let way = 0.1 * h * f64::from(tick);
        let position_m = [rest[0] + 0.4 * way, rest[1] - 0.3 * way, rest[2] + way];
        assert!(
            step(
                &model,
                &mut state,
                Some(Held {
                    element,
                    position_m,
                    patch_m: 0.0
                }),
                1e-3
            )
            .converged
        );
    }
    (scene, model, state)
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|n| (a[n] - b[n]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn point_is_found_where_it_is_in_a_deformed_body() {
    let (scene, model, state) = deformed();
    let mut random = Random(11);
    let (mut found, mut same) = (0, 0);
    for _ in 0..3000 {
        let element = (random.unit() * model.element_count() as f64) as u32;
        let local = [(); 3].map(|()| 0.45 * random.signed() as f32);
        let point = MaterialPoint { element, local };
        let position = point.position_m(&state.deformed(&model));
        for hint in [Some(element), Some(0), Some(u32::MAX), None] {
            let Some(again) = MaterialPoint::locate(&state.deformed(&model), position, hint) else {
                assert!(
                    scene.lattice.neighbours(element).contains(&None),
                    "lost inside the body"
                );
                continue;
            };
            found += 1;
            same += u32::from(again.element == element);
            let apart = distance(again.position_m(&state.deformed(&model)), position);
            assert!(apart < 1e-5 * scene.lattice.spacing_m, "{apart} m apart");
        }
    }
    println!("found {found} of 12000, in the same element {same}");
    assert!(found > 11_900 && same > 11_000);
}

#[test]
fn at_rest_the_cell_is_the_element() {
    let scene = Scene::from_labels("hole", &test_bodies::with_hole()).expect("valid");
    let model = model_of(&scene);
    let state = TissueState::at_rest(&model);
    let mut random = Random(2);
    for _ in 0..3000 {
        let cell = scene.lattice.dims.map(|n| random.unit() * (n + 4) as f64 - 2.0);
        let point_m = cell.map(|c| c * scene.lattice.spacing_m);
        let expected = scene.lattice.element_at(cell.map(|c| c.floor() as i64));
        let found = MaterialPoint::locate(&state.deformed(&model), point_m, None);
        assert_eq!(found.map(|point| point.element), expected, "at {cell:?}");
    }
}

#[test]
fn outside_and_not_a_number_are_nowhere() {
    let (scene, model, state) = deformed();
    let (low, high) = scene.lattice.bounds_m();
    for point_m in [[0.0; 3], low, high, [f64::NAN; 3], [1e300, 0.0, 0.0]] {
        assert_eq!(MaterialPoint::locate(&state.deformed(&model), point_m, Some(5)), None);
    }
}

#[test]
fn direction_is_that_of_two_points_a_little_apart() {
    let (scene, model, state) = deformed();
    let element = scene.lattice.element_of_cell(55, 33, 84).expect("inside");
    let at = |local| MaterialPoint { element, local }.position_m(&state.deformed(&model));
    let (a, b) = (at([0.0; 3]), at([0.1, -0.2, 0.3]));
    let way = [0, 1, 2].map(|n| (b[n] - a[n]) / distance(a, b));
    let point = MaterialPoint {
        element,
        local: [0.0; 3],
    };
    let direction = point.direction(&state.deformed(&model), [0.1, -0.2, 0.3]);
    assert!(distance(way, direction) < 1e-6);
    assert!(
        distance(direction, [0.1, -0.2, 0.3].map(|c| c / 0.14_f64.sqrt())) > 1e-3,
        "it turned"
    );
    assert_eq!(point.direction(&state.deformed(&model), [0.0; 3]), [0.0; 3]);
}

#[test]
fn surface_is_written_in_metres() {
    let (scene, model, state) = deformed();
    let mut positions = vec![[0.0; 3]; scene.surface.vertex_elements.len()];
    state.deformed(&model).write_surface(&scene.surface, &mut positions);
    for (position, &element) in positions.iter().zip(&scene.surface.vertex_elements) {
        let expected = state.deformed(&model).position_m(element);
        assert!(distance(position.map(f64::from), expected) < 1e-7);
    }
}
