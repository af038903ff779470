//! Violations left by the pass.

use super::*;
use stylet_sim::limits::TissueParameters;
use stylet_sim::scene::Scene;

fn body(scene: &Scene) -> Body {
    Body::at_rest(scene, &TissueParameters::default().validate().expect("valid"))
}

#[test]
fn a_long_step_in_the_gland_leaves_violations_after_one_pass() {
    let scene = Scene::builtin("paper").expect("built in");
    let held = scene.lattice.element_of_cell(53, 31, 88).expect("inside");
    let at = [3.0, -2.0, 5.0];
    let mut body = body(&scene);
    PlainQueue::new(&scene.lattice).run(&mut body, held, at);
    let violation = body.largest_violation();
    assert!(violation > 0.1, "{violation}");
    assert_eq!(body.u.each_ref().map(|c| c[held as usize]), at);
}
