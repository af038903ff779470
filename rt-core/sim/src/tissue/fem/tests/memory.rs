//! Claims about what a flight recording keeps of an elastic body: on a needle line its displacements are all of it.

use super::*;
use crate::tissue::{ElementField, Held, PackedField, Shift, TissueModel};
use stylet_heap as heap;

fn body() -> (Scene, FemTissue<f32>) {
    let labels = Labels {
        dims: [8, 8, 12],
        spacing_m: 1e-3,
        cells: vec![1; 8 * 8 * 12],
        structures: Vec::new(),
    };
    let scene = Scene::from_labels("block", &labels).expect("valid");
    let tissue = FemTissue::new(&scene).expect("valid");
    (scene, tissue)
}

fn held(scene: &Scene, by_m: f64) -> Held {
    let element = scene.lattice.element_of_cell(4, 4, 2).expect("inside");
    let mut position_m = scene.lattice.rest_m(element);
    position_m[2] += by_m;
    Held {
        element,
        position_m,
        patch_m: 4e-3,
    }
}

fn columns(scene: &Scene) -> Vec<PackedField> {
    let mut column = ElementField::zeros(scene.lattice.element_count());
    for (n, u) in column.0[2].iter_mut().enumerate() {
        *u = 1e-3 * (n as f32 * 0.7).sin();
    }
    let mut packed = PackedField::zeros(scene.lattice.element_count());
    packed.pack(&column);
    vec![packed]
}

/// Answers to what was held before a line were kept and went into later steps, so that no recording could begin on one.
#[test]
fn a_body_on_a_line_continues_from_its_memory_in_every_bit() {
    let (scene, mut first) = body();
    assert!(first.is_all_saved(), "a new one");
    for n in 1..8 {
        first.step(Some(held(&scene, 2e-4 * f64::from(n))), 5e-3);
        first.prepare(Some(held(&scene, 2e-4 * f64::from(n + 1))));
    }
    assert!(!first.is_all_saved(), "the solver is in the middle of it");
    first.displace(&columns(&scene), &[2.0], Shift::of_all([0.0, 0.0, 1e-3]));
    assert!(first.is_all_saved());
    let mut memory = vec![0; first.memory_len()];
    let calls = heap::calls_of_this_thread();
    first.save(&mut memory);
    assert_eq!(heap::calls_of_this_thread(), calls, "calls of the heap");
    let mut second = body().1;
    second.step(Some(held(&scene, 1e-3)), 5e-3);
    second.load(&memory);
    let places = |body: &FemTissue<f32>| [0, 1, 2].map(|a| body.state.displacement(a).to_vec());
    assert_eq!(places(&first), places(&second));
    assert_eq!(first.deformed().reach, second.deformed().reach);
    for n in 1..8 {
        let grip = held(&scene, 3e-4 * f64::from(n));
        assert_eq!(
            first.step(Some(grip), 5e-3),
            second.step(Some(grip), 5e-3),
            "step {n} after it"
        );
        assert_eq!(places(&first), places(&second), "step {n} after it");
    }
}
