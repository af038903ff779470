//! The two passes against each other, and what they leave violated.

use super::*;
use stylet_sim::limits::TissueParameters;
use stylet_sim::scene::{Labels, Scene};

fn body(scene: &Scene) -> Body {
    Body::at_rest(scene, &TissueParameters::default().validate().expect("valid"))
}

#[test]
fn one_pass_of_the_queue_and_of_the_sweeps_gives_the_same_bits_on_a_block() {
    let labels = Labels {
        dims: [9, 8, 7],
        spacing_m: 1e-3,
        cells: vec![1; 9 * 8 * 7],
        structures: Vec::new(),
    };
    let scene = Scene::from_labels("block", &labels).expect("valid");
    let held = scene.lattice.element_of_cell(4, 3, 2).expect("inside");
    let (mut by_queue, mut by_sweep) = (body(&scene), body(&scene));
    let at = [30.0, -25.0, 40.0];
    let moved = PlainQueue::new(&scene.lattice).run(&mut by_queue, held, at);
    PlainSweep::new(&scene.lattice).run(&mut by_sweep, held, at);
    assert_eq!(moved as usize, scene.lattice.element_count());
    assert_eq!(by_queue.u, by_sweep.u);
}

#[test]
fn a_long_step_in_the_gland_leaves_violations_after_one_pass() {
    let scene = Scene::builtin("paper").expect("built in");
    let held = scene.lattice.element_of_cell(53, 31, 88).expect("inside");
    let at = [3.0, -2.0, 5.0];
    let (mut by_queue, mut by_sweep) = (body(&scene), body(&scene));
    PlainQueue::new(&scene.lattice).run(&mut by_queue, held, at);
    PlainSweep::new(&scene.lattice).run(&mut by_sweep, held, at);
    for body in [by_queue, by_sweep] {
        let violation = body.largest_violation();
        assert!(violation > 0.1, "{violation}");
        let now = body.deformed().displacement(held);
        assert_eq!(now, at.map(f64::from));
    }
}
