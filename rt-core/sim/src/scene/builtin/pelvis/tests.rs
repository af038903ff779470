//! Claims about the pelvis: sizes, what touches what, and that a needle finds its way.

use crate::scene::builtin::pelvis::Pelvis;
use crate::scene::builtin::shape::Rod;
use crate::scene::{Lattice, Role, Scene, SceneError, SceneProblem, TissueKind};
use std::f64::consts::PI;

fn pelvis() -> Scene {
    Scene::builtin("pelvis").expect("built in")
}

fn number(scene: &Scene, name: &str) -> u8 {
    let found = scene.structures.iter().position(|s| s.name == name);
    found.unwrap_or_else(|| panic!("no {name}")) as u8
}

fn elements_of(scene: &Scene, names: &[&str]) -> Vec<u32> {
    let numbers: Vec<u8> = names.iter().map(|name| number(scene, name)).collect();
    let all = 0..scene.lattice.element_count() as u32;
    all.filter(|&e| numbers.contains(&scene.lattice.structure(e))).collect()
}

fn cc(scene: &Scene, names: &[&str]) -> f64 {
    elements_of(scene, names).len() as f64 * (scene.lattice.spacing_m * 100.0).powi(3)
}

/// Parts into which the elements fall that links (six neighbours) join.
fn connected_parts(lattice: &Lattice, elements: &[u32]) -> usize {
    let mut open: std::collections::BTreeSet<u32> = elements.iter().copied().collect();
    let mut parts = 0;
    while let Some(start) = open.pop_first() {
        parts += 1;
        let mut edge = vec![start];
        while let Some(element) = edge.pop() {
            let beside = lattice.neighbours(element).into_iter().flatten();
            edge.extend(beside.filter(|n| open.remove(n)));
        }
    }
    parts
}

#[test]
fn structures_are_as_large_as_their_formulas_say() {
    let scene = pelvis();
    for s in &scene.structures {
        println!(
            "{}: {:.2} cc, {} elements",
            s.name,
            cc(&scene, &[&s.name]),
            elements_of(&scene, &[&s.name]).len()
        );
    }
    println!(
        "all: {} elements, {} vertices",
        scene.lattice.element_count(),
        scene.surface.vertex_elements.len()
    );
    let near = |what: &str, actual: f64, expected: f64, share: f64| {
        println!("{what}: {actual:.2} cc, formula {expected:.2} cc");
        assert!(
            (actual - expected).abs() <= share * expected,
            "{what}: {actual} cc, not {expected}"
        );
    };
    let tube_cc = PI * 0.35_f64.powi(2) * 7.04;
    near("urethra", cc(&scene, &["urethra"]), tube_cc, 0.05);
    let ellipsoid_cc = |wall: f64| 4.0 / 3.0 * PI * (3.2 - wall) * (2.4 - wall) * (2.6 - wall);
    near(
        "bladder content",
        cc(&scene, &["bladder content"]),
        ellipsoid_cc(0.35),
        0.02,
    );
    let bladder = cc(&scene, &["bladder content", "bladder wall"]);
    near("bladder", bladder, ellipsoid_cc(0.0), 0.02);
    let rod_cc = |radius: f64, length: f64| PI * radius * radius * (length + 4.0 / 3.0 * radius);
    let ramus = (3.6_f64.powi(2) + 2.52_f64.powi(2) + 4.47_f64.powi(2)).sqrt();
    let rods = rod_cc(0.7, 3.007) + 2.0 * rod_cc(0.6, ramus);
    // Where the three meet, about two balls' worth is counted twice.
    near(
        "pubic arch",
        cc(&scene, &["pubic arch"]),
        rods - 2.0 * 4.0 / 3.0 * PI * 0.6_f64.powi(3),
        0.05,
    );
    // One slice of the rectum at the height of the gland's middle.
    let slice = elements_of(&scene, &["rectal wall"]);
    let slice = slice.iter().filter(|&&e| scene.lattice.cell(e)[2] == 88).count() as f64;
    let wall_cc = slice * scene.lattice.spacing_m.powi(2) * 1e4;
    near("1 cm of rectal wall", wall_cc, PI * (1.5 * 0.95 - 1.15 * 0.6), 0.07);
}

#[test]
fn the_prostate_is_the_gland_of_the_paper() {
    let (scene, paper) = (pelvis(), Scene::builtin("paper").expect("built in"));
    let inside = |e: u32| {
        let [i, j, k] = scene.lattice.cell(e);
        paper.lattice.element_of_cell(i, j, k).is_some()
    };
    let prostate = elements_of(&scene, &["gland", "capsule"]);
    assert!(prostate.iter().all(|&e| inside(e)));
    let urethra = elements_of(&scene, &["urethra"])
        .into_iter()
        .filter(|&e| inside(e))
        .count();
    assert_eq!(prostate.len() + urethra, paper.lattice.element_count());
    // 10 mm2 to 60 mm2 of urethra in each of about 35 slices of the gland.
    assert!(
        (600..1000).contains(&urethra),
        "{urethra} elements of urethra in the gland"
    );
    assert_eq!(scene.target_bounds_m(), paper.lattice.bounds_m());
}

#[test]
fn the_capsule_encloses_the_gland_but_for_the_urethra() {
    let scene = pelvis();
    let [capsule, gland, urethra] = ["capsule", "gland", "urethra"].map(|name| number(&scene, name));
    for element in elements_of(&scene, &["gland"]) {
        for neighbour in scene.lattice.neighbours(element) {
            let beside = scene
                .lattice
                .structure(neighbour.expect("the gland is inside the body"));
            assert!([capsule, gland, urethra].contains(&beside), "gland touches {beside}");
        }
    }
    // One element thick: each element has cells outside the prostate about it, at most a diagonal away.
    let prostate = [capsule, gland, urethra];
    for element in elements_of(&scene, &["capsule"]) {
        let [i, j, k] = scene.lattice.cell(element).map(|c| c as i64);
        let about = (0..27).map(|n| [i + n % 3 - 1, j + n / 3 % 3 - 1, k + n / 9 - 1]);
        let mut beside = about.filter_map(|cell| scene.lattice.element_at(cell));
        let is_rim =
            beside.any(|e| !prostate.contains(&scene.lattice.structure(e)) || scene.lattice.structure(e) == urethra);
        assert!(is_rim);
    }
}

#[test]
fn each_structure_hangs_together_and_the_body_is_one() {
    let scene = pelvis();
    for s in &scene.structures {
        let parts = connected_parts(&scene.lattice, &elements_of(&scene, &[&s.name]));
        assert_eq!(parts, 1, "{} falls into {parts} parts", s.name);
    }
    let all: Vec<u32> = (0..scene.lattice.element_count() as u32).collect();
    assert_eq!(connected_parts(&scene.lattice, &all), 1);
}

#[test]
fn the_rectum_is_hollow_and_closed_below() {
    let scene = pelvis();
    let [_, ny, _] = scene.lattice.dims;
    let hollow = |k: usize| {
        let column = (0..ny).map(|j| scene.lattice.element_of_cell(53, j, k).is_some());
        let tissue: Vec<bool> = column.collect();
        let (first, last) = (tissue.iter().position(|&t| t), tissue.iter().rposition(|&t| t));
        tissue[first.unwrap_or(0)..last.unwrap_or(0)].contains(&false)
    };
    assert!(hollow(88) && hollow(120) && !hollow(55));
}

/// As the default plan goes: along z, beside the urethra, and the whole breadth of the gland about it.
#[test]
fn the_needle_s_corridor_below_the_arch_is_free_of_bone() {
    let scene = pelvis();
    let lattice = &scene.lattice;
    let (lower, upper) = scene.target_bounds_m();
    let middle = [0, 1].map(|a| 0.5 * (lower[a] + upper[a]));
    let bone = number(&scene, "pubic arch");
    let base_k = (upper[2] / lattice.spacing_m) as usize;
    let (mut met_gland, mut nearest_mm) = (false, f64::MAX);
    for k in 0..base_k {
        for j in 0..lattice.dims[1] {
            for i in 0..lattice.dims[0] {
                let Some(element) = lattice.element_of_cell(i, j, k) else {
                    continue;
                };
                let at = lattice.rest_m(element);
                let beside_mm = (at[0] - middle[0]).abs().max((at[1] - middle[1]).abs()) * 1e3;
                if lattice.structure(element) == bone {
                    nearest_mm = nearest_mm.min(beside_mm);
                }
                met_gland |=
                    beside_mm < 1.0 && scene.structures[lattice.structure(element) as usize].role == Role::Target;
            }
        }
    }
    println!("bone is {nearest_mm:.1} mm beside the middle of the gland, as the needle sees it");
    assert!(met_gland);
    // Needles of a 20 mm wide template pass with 2 mm to spare.
    assert!(nearest_mm > 12.0);
}

#[test]
fn a_structure_that_leaves_the_volume_is_refused_with_its_reach() {
    let mut pelvis = Pelvis::default();
    pelvis.bladder.centre_m[1] = 30e-3;
    pelvis.pubic_arch[0] = Rod {
        ends_m: [[f64::NAN; 3]; 2],
        radius_m: 6e-3,
    };
    let problems = pelvis.labels().expect_err("outside");
    let named = |name: &str, axis: char| {
        let found = |p: &SceneProblem| matches!(p, SceneProblem::Outside { structure, axis: a, .. } if structure == name && *a == axis);
        problems.iter().any(found)
    };
    assert!(named("bladder wall", 'y') && named("pubic arch", 'x') && named("pubic arch", 'z'));
    let text = SceneError::Invalid(problems).to_string();
    assert!(
        text.contains("from 6.0 to 54.0 mm along y, the volume from -42.3 to 42.3 mm"),
        "{text}"
    );
}

#[test]
fn full_is_every_cell() {
    let scene = Scene::builtin("full").expect("built in");
    assert_eq!(scene.lattice.element_count(), 107 * 62 * 176);
    assert_eq!((scene.structures.len(), scene.surface.parts.len()), (1, 0));
    let inner = 105 * 60 * 174;
    assert_eq!(scene.surface.body_elements, 1_167_584 - inner);
}

/// In elements of twice the edge the capsule, one cell thick, would be lost: what is where is still asked of the cells.
#[test]
fn a_coarser_body_keeps_what_is_where() {
    let scene = Scene::builtin("pelvis").unwrap().for_tissue(TissueKind::Fem);
    assert_eq!((scene.coarseness(), scene.body.element_count()), (2, 53_951));
    assert_eq!(scene.surface.moved_by.len(), scene.surface.vertex_elements.len());
    for element in 0..scene.lattice.element_count() as u32 {
        let place_m = scene.lattice.rest_m(element);
        let around = scene
            .body
            .element_at_rest(place_m)
            .expect("every cell is in an element");
        let middle_m = scene.body.rest_m(around);
        let local = [0, 1, 2].map(|a| ((place_m[a] - middle_m[a]) / scene.body.spacing_m) as f32);
        assert_eq!(scene.structure_at(around, local), scene.lattice.structure(element));
    }
    let again = scene.for_tissue(TissueKind::ChainMail);
    assert!(again.coarseness() == 1 && again.surface.moved_by.is_empty());
}
