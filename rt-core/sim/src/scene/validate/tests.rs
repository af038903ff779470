//! Every refusal of a scene, by what it says.

use crate::limits::AxisLimits;
use crate::scene::{Labels, Material, Role, Scene, SceneError, SceneProblem, Structure, test_bodies};

fn refusal(labels: &Labels) -> Vec<SceneProblem> {
    Scene::from_labels("bad", labels).expect_err("refused")
}

fn text_of(problems: Vec<SceneProblem>) -> String {
    SceneError::Invalid(problems).to_string()
}

/// Returns a block whose lower half has label 1 and upper half label 2.
fn halves(structures: Vec<Structure>) -> Labels {
    let mut labels = test_bodies::block([4, 4, 4]);
    labels.cells[32..].fill(2);
    labels.structures = structures;
    labels
}

fn two() -> Vec<Structure> {
    vec![Structure::soft("gland", 1), Structure::soft("fat", 2)]
}

fn with_material(change: impl Fn(&mut Material)) -> Labels {
    let mut structures = two();
    change(&mut structures[1].material);
    halves(structures)
}

fn limits(min_stretch: f64, max_stretch: f64, shear_deg: f64) -> AxisLimits {
    AxisLimits {
        min_stretch,
        max_stretch,
        shear_deg,
    }
}

#[test]
fn two_structures_are_a_scene_and_elements_know_theirs() {
    let scene = Scene::from_labels("good", &halves(two())).expect("valid");
    assert_eq!(scene.lattice.structure(0), 0);
    assert_eq!(scene.lattice.structure(63), 1);
}

#[test]
fn every_problem_is_listed_at_once() {
    let labels = Labels {
        dims: [0, 2000, 3],
        spacing_m: f64::NAN,
        cells: vec![0; 5],
        structures: Vec::new(),
    };
    let problems = refusal(&labels);
    assert_eq!(problems.len(), 5);
    let text = text_of(problems);
    for part in ["along x", "2000", "1024", "5 labels", "NaN", "0 elements"] {
        assert!(text.contains(part), "{part} not in: {text}");
    }
}

#[test]
fn too_many_elements_are_refused_by_number() {
    let dims = [200, 200, 101];
    let mut labels = test_bodies::block(dims);
    labels.spacing_m = 1e-3;
    let elements = 4_040_000;
    assert_eq!(refusal(&labels), [SceneProblem::TooManyElements { elements }]);
}

#[test]
fn labels_and_structures_that_do_not_fit_each_other_are_all_named() {
    let mut structures = vec![
        Structure::soft("gland", 1),
        Structure::soft("zero", 0),
        Structure::soft("twin", 1),
        Structure::soft("nowhere", 9),
    ];
    structures[0].role = Role::Tissue;
    let text = text_of(refusal(&halves(structures)));
    for part in [
        "4 problem(s)",
        "\"zero\" has label 0",
        "\"gland\" and \"twin\" both have label 1",
        "\"nowhere\" has no cell (label 9): it is empty or lies outside the volume",
        "32 cells have label 2, which no structure has",
    ] {
        assert!(text.contains(part), "{part} not in: {text}");
    }
}

#[test]
fn more_structures_than_labels_are_refused_by_number() {
    let structures = (0..256).map(|n| Structure::soft("s", n as u8)).collect();
    let problems = refusal(&halves(structures));
    assert!(problems.contains(&SceneProblem::TooManyStructures { structures: 256 }));
}

#[test]
fn a_body_that_is_fixed_all_over_is_refused() {
    let mut structures = two();
    structures[0].material.fixed = true;
    assert!(Scene::from_labels("half fixed", &halves(structures.clone())).is_ok());
    structures[1].material.fixed = true;
    assert_eq!(refusal(&halves(structures)), [SceneProblem::AllFixed]);
}

#[test]
fn elastic_constants_out_of_range_are_refused_with_their_value() {
    for (young_pa, poisson, parts) in [
        (f64::NAN, 0.49, "young_pa is NaN"),
        (0.0, 0.49, "young_pa is 0"),
        (f64::INFINITY, 0.49, "young_pa is inf"),
        (17e3, 0.5, "poisson is 0.5, must be from 0 to 0.499"),
        (17e3, -0.1, "poisson is -0.1"),
        (17e3, f64::NAN, "poisson is NaN"),
    ] {
        let labels = with_material(|m| (m.young_pa, m.poisson) = (young_pa, poisson));
        let problems = refusal(&labels);
        assert_eq!(problems.len(), 1);
        let text = text_of(problems);
        assert!(text.contains("structure \"fat\"") && text.contains(parts), "{text}");
    }
    assert!(Scene::from_labels("edge", &with_material(|m| m.poisson = 0.499)).is_ok());
}

#[test]
fn limits_that_are_none_or_fold_cells_are_refused() {
    let paper = limits(0.55, 1.75, 26.565);
    for (x, parts) in [
        (limits(f64::NAN, 1.75, 20.0), ["min_stretch along x is NaN"].as_slice()),
        (
            limits(1.5, 0.5, 20.0),
            &["min_stretch along x is 1.5, must be at most max_stretch"],
        ),
        (limits(0.55, f64::INFINITY, 20.0), &["max_stretch along x is inf"]),
        (limits(0.55, 1.75, f64::NAN), &["shear_deg along x is NaN"]),
        (limits(0.55, 1.75, -1.0), &["shear_deg along x is -1"]),
        (limits(0.55, 1.75, 64.0), &["eq. 1 in three dimensions"]),
        (limits(0.55, 1.75, 30.0), &["eq. 1 in three dimensions"]),
    ] {
        let text = text_of(refusal(&with_material(|m| m.limits = Some([x, paper, paper]))));
        for part in parts {
            assert!(text.contains(part), "{part} not in: {text}");
        }
    }
}

#[test]
fn structures_that_fold_a_shared_corner_are_refused() {
    let paper = limits(0.55, 1.75, 26.565);
    let (wide, narrow) = (limits(0.55, 1.75, 60.0), limits(0.55, 1.75, 5.0));
    let mut labels = halves(two());
    labels.structures[0].material.limits = Some([wide, narrow, narrow]);
    assert!(Scene::from_labels("one wide", &labels).is_ok());
    labels.structures[1].material.limits = Some([narrow, wide, narrow]);
    let text = text_of(refusal(&labels));
    assert!(text.contains("all structures together"), "{text}");
    let edge = with_material(|m| m.limits = Some([paper; 3]));
    assert!(Scene::from_labels("the paper's limits", &edge).is_ok());
    let anisotropic =
        with_material(|m| m.limits = Some([limits(1.0, 1.0, 40.0), limits(0.5, 2.0, 10.0), limits(0.55, 1.75, 20.0)]));
    assert!(Scene::from_labels("anisotropic", &anisotropic).is_ok());
}

#[test]
fn unknown_scene_names_the_known_ones() {
    let error = Scene::builtin("papper").expect_err("not a scene");
    assert!(error.to_string().contains("paper, pelvis, full"));
}
