//! Where the probe stands in a scene, and where the holes of a template are drawn.

use super::plane;
use crate::ultrasound::{Pose, View};
use bytemuck::Zeroable;
use nalgebra::Vector3;
use stylet_shm_schema::{SceneHeader, Text};

#[test]
fn a_hole_is_drawn_where_a_needle_through_it_crosses_the_plane() {
    let plane = plane(View::Transverse);
    let hole = Vector3::new(7e-3, 22e-3, -60e-3);
    let straight = plane.crossing(hole, Vector3::z()).expect("across the plane");
    assert!((straight - plane.pixel_of(Vector3::new(7e-3, 22e-3, 0.0))).norm() < 1e-9);
    let oblique = plane.crossing(hole, Vector3::new(0.1, -0.05, 1.0).normalize());
    let expected = plane.pixel_of(Vector3::new(13e-3, 19e-3, 0.0));
    assert!((oblique.expect("across the plane") - expected).norm() < 1e-9);
    assert_eq!(plane.crossing(hole, Vector3::x()), None, "along the plane");
}

/// A patient on his side: superior is y of the scene, anterior is x.
#[test]
fn the_probe_lies_in_the_rectum_at_the_middle_of_the_target() {
    let mut scene = SceneHeader::zeroed();
    scene.patient_from_scene = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
    (scene.target_lower_m, scene.target_upper_m) = ([-20e-3, -25e-3, -22e-3], [20e-3, 15e-3, 22e-3]);
    let behind = Pose::of_scene(&scene);
    assert!((behind.up - Vector3::x()).norm() < 1e-12 && (behind.axis - Vector3::y()).norm() < 1e-12);
    assert!(
        (behind.middle_m - Vector3::new(-35e-3, -5e-3, 0.0)).norm() < 1e-9,
        "{}",
        behind.middle_m
    );
    scene.structure_count = 1;
    scene.structures[0].name = Text::new("rectal wall");
    (scene.structures[0].lower_m, scene.structures[0].upper_m) = ([-40e-3, -90e-3, -16e-3], [-22e-3, 40e-3, 20e-3]);
    let within = Pose::of_scene(&scene);
    assert!(
        (within.middle_m - Vector3::new(-31e-3, -5e-3, 2e-3)).norm() < 1e-9,
        "{}",
        within.middle_m
    );
    let moved = within.moved(5e-3, 90_f64.to_radians());
    assert!((moved.middle_m - within.middle_m - within.axis * 5e-3).norm() < 1e-12);
    // From anterior to the patient's left: his right is z here.
    assert!((moved.up + Vector3::z()).norm() < 1e-9, "{}", moved.up);
}
