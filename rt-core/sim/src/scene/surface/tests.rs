//! Claims about the surface mesh: closed, outward, without degenerate triangles.

use super::*;
use crate::scene::{Labels, Scene, test_bodies};
use std::sync::Arc;

fn surface_of(labels: &Labels) -> (Arc<Lattice>, Surface) {
    let scene = Scene::from_labels("test", labels).expect("valid labels");
    (scene.lattice, scene.surface)
}

fn assert_closed(triangles: &[[u32; 3]]) {
    let mut balance: BTreeMap<(u32, u32), i32> = BTreeMap::new();
    for &[a, b, c] in triangles {
        assert!(a != b && b != c && c != a, "degenerate triangle");
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *balance.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
        }
    }
    assert!(balance.values().all(|&count| count == 0), "open edge");
}

fn signed_volume_m3(lattice: &Lattice, surface: &Surface) -> f64 {
    volume_of_m3(lattice, surface, &surface.triangles)
}

fn volume_of_m3(lattice: &Lattice, surface: &Surface, triangles: &[[u32; 3]]) -> f64 {
    let point = |vertex: u32| lattice.rest_m(surface.vertex_elements[vertex as usize]);
    let six_fold = triangles.iter().map(|&[a, b, c]| {
        let (a, b, c) = (point(a), point(b), point(c));
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    });
    six_fold.sum::<f64>() / 6.0
}

#[test]
fn block_surface_encloses_the_box_through_its_outer_centres() {
    let (lattice, surface) = surface_of(&test_bodies::block([5, 4, 3]));
    assert_closed(&surface.triangles);
    let expected = 4.0 * 3.0 * 2.0 * lattice.spacing_m.powi(3);
    assert!((signed_volume_m3(&lattice, &surface) - expected).abs() < 1e-9 * expected);
    let on_block = surface.vertex_elements.len();
    assert_eq!(surface.triangles.len(), 2 * on_block - 4);
}

#[test]
fn surfaces_of_hard_bodies_are_closed_and_outward() {
    for labels in [
        test_bodies::with_hole(),
        test_bodies::two_parts(),
        test_bodies::speckle(7),
    ] {
        let (lattice, surface) = surface_of(&labels);
        assert_closed(&surface.triangles);
        assert!(signed_volume_m3(&lattice, &surface) > 0.0);
    }
}

#[test]
fn one_element_thick_bodies_have_vertices_and_no_open_edge() {
    for dims in [[6, 5, 1], [1, 7, 4], [9, 1, 1], [1, 1, 1]] {
        let (lattice, surface) = surface_of(&test_bodies::block(dims));
        assert_closed(&surface.triangles);
        assert_eq!(surface.vertex_elements.len(), lattice.element_count());
    }
}

#[test]
fn paper_surface_is_closed_and_outward() {
    let scene = Scene::builtin("paper").expect("built in");
    assert_closed(&scene.surface.triangles);
    assert!(signed_volume_m3(&scene.lattice, &scene.surface) > 0.0);
}

#[test]
fn surfaces_of_the_pelvis_are_closed_and_enclose_their_structures() {
    let scene = Scene::builtin("pelvis").expect("built in");
    let (lattice, surface) = (&scene.lattice, &scene.surface);
    assert_closed(&surface.triangles[..surface.body_triangles]);
    let names: Vec<_> = surface
        .parts
        .iter()
        .map(|part| &scene.structures[part.structure as usize].name)
        .collect();
    assert_eq!(names, ["gland", "urethra", "rectal wall", "bladder wall", "pubic arch"]);
    let mut next = surface.body_triangles;
    for part in &surface.parts {
        assert_eq!(part.triangles.start, next);
        next = part.triangles.end;
        let triangles = &surface.triangles[part.triangles.clone()];
        assert_closed(triangles);
        let is_in = |e: &u32| match part.structure {
            0 => scene.structures[lattice.structure(*e) as usize].role == Role::Target,
            alone => lattice.structure(*e) == alone,
        };
        let elements = (0..lattice.element_count() as u32).filter(is_in).count();
        let inside = volume_of_m3(lattice, surface, triangles) / lattice.spacing_m.powi(3);
        // The mesh runs through the outermost centres: it holds less than the elements do, by about half of their skin.
        let on_it = boundary(lattice, |e| is_in(&e)).len() as f64;
        let missing = (elements as f64 - inside) / on_it;
        assert!(
            (0.3..0.8).contains(&missing),
            "{missing} of an element of skin is missing"
        );
    }
    assert_eq!(next, surface.triangles.len());
}
