//! A body that moves as a whole on its foundation, on top of what ChainMail does.

use super::*;
use crate::scene::{Scene, TissueKind};
use crate::tissue::{BodyShift, Carry, MaterialPoint, TissueModel};

fn tissue() -> (Scene, ChainMailTissue) {
    let scene = Scene::builtin("paper").unwrap();
    let limits = TissueParameters::default().validate().unwrap();
    let tissue = ChainMailTissue::new(&scene, limits);
    (scene, tissue)
}

const SHIFT: BodyShift = BodyShift {
    shift_m: [0.0, 5e-4, 2e-3],
    turn_rad: [0.02, 0.0, 0.0],
};

/// ChainMail alone leaves a gland where it is while its middle is pushed by millimetres.
#[test]
fn a_body_that_is_carried_moves_as_a_whole_and_holds_what_it_was_asked_to() {
    let (scene, mut tissue) = tissue();
    let element = scene.lattice.element_of_cell(53, 31, 80).unwrap();
    let mut position_m = scene.lattice.rest_m(element);
    position_m[2] += 6e-3;
    tissue.carry(Carry::Shift(SHIFT));
    let held = Held {
        element,
        position_m,
        patch_m: 0.0,
    };
    let report = tissue.step(Some(held), 5e-3);
    assert!(report.converged && report.held == HeldOutcome::Followed, "{report:?}");
    let body = tissue.deformed();
    for (now, asked) in body.position_m(element).into_iter().zip(position_m) {
        assert!((now - asked).abs() < 1e-8, "{now} {asked}");
    }
    // An element far from what is held moves with the whole, and a point of the material is found where that is.
    let far = 0;
    let moved_m = [0, 1, 2].map(|a| body.position_m(far)[a] - scene.lattice.rest_m(far)[a]);
    let whole_m = SHIFT.at_m(scene.lattice.rest_m(far));
    assert!(
        (0..3).all(|a| (moved_m[a] - whole_m[a]).abs() < 1e-9),
        "{moved_m:?} {whole_m:?}"
    );
    let found = MaterialPoint::locate(&body, body.position_m(far), None).expect("in the body");
    assert_eq!(found.element, far);
    let farthest = (0..scene.lattice.element_count() as u32)
        .map(|e| body.displacement(e).iter().map(|c| c * c).sum::<f64>().sqrt())
        .fold(0.0, f64::max);
    assert!(farthest <= f64::from(report.max_displacement), "{farthest} {report:?}");
    tissue.carry(Carry::Not);
    tissue.return_to_rest();
    assert_eq!(tissue.deformed().displacement(far), [0.0; 3]);
}

#[test]
fn how_a_body_is_carried_is_part_of_its_memory() {
    let (_, mut tissue) = tissue();
    tissue.carry(Carry::Shift(SHIFT));
    tissue.step(None, 5e-3);
    let mut memory = vec![0; tissue.memory_len()];
    tissue.save(&mut memory);
    let (scene, mut other) = self::tissue();
    other.load(&memory);
    let (a, b) = (tissue.deformed(), other.deformed());
    assert!((0..scene.lattice.element_count() as u32).all(|e| a.displacement(e) == b.displacement(e)));
    assert_ne!(a.displacement(0), [0.0; 3]);
}

#[test]
fn lines_of_chainmail_are_solved_for_in_a_body_that_is_soon_solved() {
    for name in ["paper", "pelvis"] {
        let scene = Scene::builtin(name).unwrap();
        let all = scene.lattice.element_count();
        let coarse = scene.clone().for_lines(TissueKind::ChainMail).expect("has lines");
        assert!(coarse.body.element_count() <= 8_000 && coarse.lattice.element_count() == all);
        assert!(scene.for_lines(TissueKind::Paper).is_none());
    }
}

/// A body with something fixed in it cannot move as one piece; the answers of the line's coarser body carry it.
#[test]
fn a_body_that_is_held_is_carried_by_the_columns_of_its_line() {
    let scene = Scene::builtin("pelvis").unwrap();
    let limits = TissueParameters::default().validate().unwrap();
    let coarse = scene.body_of_lines().expect("has lines");
    let mut by = crate::tissue::ElementField::zeros(coarse.element_count());
    by.0[2].fill(1e-3);
    let mut column = crate::tissue::PackedField::zeros(coarse.element_count());
    column.pack(&by);
    let mut tissue = ChainMailTissue::new(&scene, limits.clone());
    tissue.carry(Carry::Columns(&[column], &[2.0]));
    let report = tissue.step(None, 5e-3);
    assert!(report.converged && report.max_displacement >= (2e-3 / scene.lattice.spacing_m) as f32);
    let is_fixed = |e: u32| {
        let structure = usize::from(scene.lattice.structure(e));
        scene.structures[structure].material.fixed
    };
    let body = tissue.deformed();
    for element in (0..scene.lattice.element_count() as u32).step_by(97) {
        let moved_m = body.displacement(element)[2] * scene.lattice.spacing_m;
        let wanted_m = if is_fixed(element) { 0.0 } else { 2e-3 };
        assert!((moved_m - wanted_m).abs() < 1e-6, "{moved_m} {wanted_m}");
    }
    let mut memory = vec![0; tissue.memory_len()];
    tissue.save(&mut memory);
    let mut other = ChainMailTissue::new(&scene, limits);
    other.load(&memory);
    let soft = (0..scene.lattice.element_count() as u32)
        .find(|&e| !is_fixed(e))
        .expect("tissue");
    assert_eq!(other.deformed().displacement(soft), body.displacement(soft));
    tissue.carry(Carry::Not);
    assert_eq!(tissue.deformed().displacement(soft), [0.0; 3]);
}
