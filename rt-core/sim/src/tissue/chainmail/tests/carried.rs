//! A body that is carried by the answers of a coarser one, on top of what ChainMail does.

use super::*;
use crate::scene::{Lattice, Scene, TissueKind};
use crate::tissue::{Carry, ElementField, MaterialPoint, PackedField, Shift, TissueModel, least_corner};

fn tissue() -> (Scene, ChainMailTissue) {
    let scene = Scene::builtin("paper").unwrap();
    let limits = TissueParameters::default().validate().unwrap();
    let tissue = ChainMailTissue::new(&scene, limits);
    (scene, tissue)
}

/// Returns the displacement by a newton: the body goes along z, and is turned and sheared a little.
fn per_newton([x, y, z]: [f64; 3]) -> [f64; 3] {
    [0.01 * y, 2.5e-4 - 0.01 * x + 0.01 * z, 1e-3 - 0.005 * y]
}

fn column(coarse: &Lattice) -> PackedField {
    let mut by = ElementField::zeros(coarse.element_count());
    for element in 0..coarse.element_count() as u32 {
        let u = per_newton(coarse.rest_m(element));
        for (axis, u) in by.0.iter_mut().zip(u) {
            axis[element as usize] = u as f32;
        }
    }
    let mut column = PackedField::zeros(coarse.element_count());
    column.pack(&by);
    column
}

/// ChainMail alone leaves a gland where it is while its middle is pushed by millimetres.
#[test]
fn a_carried_body_follows_its_field_and_its_held_element() {
    let (scene, mut tissue) = tissue();
    let coarse = scene.coarser_body(ChainMailTissue::MOST_LINE_ELEMENTS);
    let element = scene.lattice.element_of_cell(53, 31, 80).unwrap();
    let mut position_m = scene.lattice.rest_m(element);
    position_m[2] += 6e-3;
    let columns = [column(&coarse)];
    tissue.carry(Carry {
        columns: &columns,
        loads_n: &[2.0],
        shift: Shift::of_all([0.0, 0.0, 5e-4]),
        ..Carry::NOT
    });
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
    // An element far from what is held moves with the field, half a coarse element at most from where that is known,
    // and a point of the material is found where it is.
    let far = 0;
    let moved_m = [0, 1, 2].map(|a| body.position_m(far)[a] - scene.lattice.rest_m(far)[a]);
    let mut wanted_m = per_newton(scene.lattice.rest_m(far)).map(|u| 2.0 * u);
    wanted_m[2] += 5e-4;
    let bound_m = 2.0 * 0.02 * coarse.spacing_m;
    assert!(
        (0..3).all(|a| (moved_m[a] - wanted_m[a]).abs() < bound_m),
        "{moved_m:?} {wanted_m:?}"
    );
    let found = MaterialPoint::locate(&body, body.position_m(far), None).expect("in the body");
    assert_eq!(found.element, far);
    let farthest = (0..scene.lattice.element_count() as u32)
        .map(|e| body.displacement(e).iter().map(|c| c * c).sum::<f64>().sqrt())
        .fold(0.0, f64::max);
    assert!(farthest <= f64::from(report.max_displacement), "{farthest} {report:?}");
    tissue.carry(Carry::NOT);
    tissue.return_to_rest();
    assert_eq!(tissue.deformed().displacement(far), [0.0; 3]);
}

#[test]
fn how_a_body_is_carried_is_part_of_its_memory() {
    let (scene, mut tissue) = tissue();
    let columns = [column(&scene.coarser_body(ChainMailTissue::MOST_LINE_ELEMENTS))];
    tissue.carry(Carry {
        columns: &columns,
        loads_n: &[-1.5],
        ..Carry::NOT
    });
    tissue.step(None, 5e-3);
    let mut memory = vec![0; tissue.memory_len()];
    tissue.save(&mut memory);
    let (_, mut other) = self::tissue();
    other.load(&memory);
    let (a, b) = (tissue.deformed(), other.deformed());
    assert!((0..scene.lattice.element_count() as u32).all(|e| a.displacement(e) == b.displacement(e)));
    assert_ne!(a.displacement(0), [0.0; 3]);
}

/// A newton squeezes the body along z, more and more towards the middle.
#[test]
fn a_body_carried_too_far_is_corrected_until_the_next_step() {
    let (scene, mut tissue) = tissue();
    let coarse = scene.coarser_body(ChainMailTissue::MOST_LINE_ELEMENTS);
    let element = scene.lattice.element_of_cell(53, 31, 80).unwrap();
    let middle_m = scene.lattice.rest_m(element);
    let mut by = ElementField::zeros(coarse.element_count());
    for n in 0..coarse.element_count() as u32 {
        let square = coarse
            .rest_m(n)
            .iter()
            .zip(middle_m)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f64>();
        by.0[2][n as usize] = (9e-3 * (-square / 6e-3_f64.powi(2)).exp()) as f32;
    }
    let mut column = PackedField::zeros(coarse.element_count());
    column.pack(&by);
    tissue.carry(Carry {
        columns: &[column],
        loads_n: &[1.0],
        ..Carry::NOT
    });
    tissue.step(None, 5e-3);
    let least = least_corner(&tissue.deformed(), element);
    assert!(least < 0.3, "{least}");
    let places = |tissue: &ChainMailTissue| {
        let body = tissue.deformed();
        let all = (0..scene.lattice.element_count() as u32).map(|e| body.displacement(e).map(f64::to_bits));
        all.collect::<Vec<_>>()
    };
    let carried = places(&tissue);
    let calls = stylet_heap::calls_of_this_thread();
    for _ in 0..10 {
        assert!(tissue.unfold(element, least));
    }
    assert_eq!(stylet_heap::calls_of_this_thread(), calls, "allocates");
    let opened = least_corner(&tissue.deformed(), element);
    println!("{least} to {opened}");
    assert!(opened > least + 0.1, "{least} to {opened}");
    let body = tissue.deformed();
    let is_found = |e: u32| MaterialPoint::locate(&body, body.position_m(e), None).is_some();
    assert!(is_found(element) && is_found(element + 1));
    let mut memory = vec![0; tissue.memory_len()];
    tissue.save(&mut memory);
    let (_, mut other) = self::tissue();
    other.load(&memory);
    assert!(places(&tissue) == places(&other));
    for tissue in [&mut tissue, &mut other] {
        tissue.unfold(element, least);
    }
    assert!(places(&tissue) == places(&other) && places(&tissue) != carried);
    // What holds the tip in the next step knows nothing of it.
    tissue.step(None, 0.0);
    assert!(places(&tissue) == carried);
}

#[test]
fn chainmail_lines_are_solved_in_a_coarser_body() {
    for name in ["paper", "pelvis"] {
        let scene = Scene::builtin(name).unwrap();
        let all = scene.lattice.element_count();
        let coarse = scene.clone().for_lines(TissueKind::ChainMail).expect("has lines");
        assert!(coarse.body.element_count() <= 8_000 && coarse.lattice.element_count() == all);
        assert!(scene.for_lines(TissueKind::Paper).is_none());
    }
}

/// By eq. 6 nothing carries the body: the mode `paper` has no room for it, and no bit of it is changed.
#[test]
fn nothing_carries_the_body_of_the_mode_paper() {
    let scene = Scene::builtin("paper").unwrap();
    let columns = [column(&scene.coarser_body(ChainMailTissue::MOST_LINE_ELEMENTS))];
    let limits = TissueParameters::default().validate().unwrap();
    let mut tissue = ChainMailTissue::as_printed(&scene, limits);
    tissue.carry(Carry {
        columns: &columns,
        loads_n: &[1.0],
        shift: Shift::of_all([1e-3; 3]),
        ..Carry::NOT
    });
    tissue.step(None, 5e-3);
    assert_eq!(tissue.deformed().displacement(0), [0.0; 3]);
}

#[test]
fn what_is_fixed_is_not_carried() {
    let scene = Scene::builtin("pelvis").unwrap();
    let limits = TissueParameters::default().validate().unwrap();
    let coarse = scene.coarser_body(ChainMailTissue::MOST_LINE_ELEMENTS);
    let mut by = ElementField::zeros(coarse.element_count());
    by.0[2].fill(1e-3);
    let mut column = PackedField::zeros(coarse.element_count());
    column.pack(&by);
    let mut tissue = ChainMailTissue::new(&scene, limits.clone());
    tissue.carry(Carry {
        columns: &[column],
        loads_n: &[2.0],
        ..Carry::NOT
    });
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
    tissue.carry(Carry::NOT);
    assert_eq!(tissue.deformed().displacement(soft), [0.0; 3]);
}
