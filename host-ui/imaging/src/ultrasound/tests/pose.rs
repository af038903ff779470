//! Pose of the probe in a scene, and projection of the holes of a template.

use super::plane;
use crate::ultrasound::{Plane, Pose, Probe, View};
use bytemuck::Zeroable;
use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};
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

/// Tests a patient on his side: superior is y of the scene, anterior is x.
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

/// Checks the convention of roll: the axis of the probe is +z of the tool, its middle beam +y.
#[test]
fn a_probe_in_the_hand_looks_where_its_tool_says() {
    let probe = Probe::default();
    let tip_m = Vector3::new(1e-3, -30e-3, 40e-3);
    let straight = Pose::of_tool(tip_m, &UnitQuaternion::identity(), &probe);
    let (axis, up) = (Vector3::z(), Vector3::y());
    assert!((straight.axis - axis).norm() < 1e-12 && (straight.up - up).norm() < 1e-12);
    assert!((straight.middle_m - Vector3::new(1e-3, -30e-3, -2.5e-3)).norm() < 1e-12);
    // Turned by 30 degrees from y towards -x, the patient's left in an unrotated scene.
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 30_f64.to_radians());
    let turned = Pose::of_tool(tip_m, &turn, &probe);
    assert!(
        (turned.up - Vector3::new(-0.5, 0.75_f64.sqrt(), 0.0)).norm() < 1e-12,
        "{}",
        turned.up
    );
    let (way_m, turn_rad) = turned.way_and_turn(&straight);
    assert!(way_m.abs() < 1e-12 && (turn_rad - 30_f64.to_radians()).abs() < 1e-12);
    assert!((straight.moved(0.0, turn_rad).up - turned.up).norm() < 1e-12);
    // Tipped by 90 degrees about x: the tip points along the former -y, and the beam along z.
    let tip = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 90_f64.to_radians());
    let tipped = Pose::of_tool(tip_m, &tip, &probe);
    assert!((tipped.axis + Vector3::y()).norm() < 1e-12 && (tipped.up - Vector3::z()).norm() < 1e-12);
    assert!((tipped.middle_m - tip_m - Vector3::y() * 42.5e-3).norm() < 1e-12);
    // A place before the centre of the array, 20 mm deep, is in the centre of the picture.
    for pose in [straight, turned, tipped] {
        let plane = Plane {
            pose,
            ..plane(View::Transverse)
        };
        let before = pose.middle_m + pose.up * 30e-3;
        assert!((plane.in_beams(before).depth_m - 20e-3).abs() < 1e-12 && plane.in_beams(before).across.abs() < 1e-12);
        let columns = Matrix3::from_columns(&[pose.up.cross(&pose.axis), pose.up, pose.axis]);
        let scene_from_tool = UnitQuaternion::from_matrix(&columns);
        let again = Pose::of_tool(pose.tip_m(&probe), &scene_from_tool, &probe);
        assert!((again.up - pose.up).norm() < 1e-12 && (again.middle_m - pose.middle_m).norm() < 1e-12);
    }
}

/// Checks pixel by pixel that the drawn rectangle contains all of the fan, and little else.
#[test]
fn all_of_the_fan_is_drawn() {
    for (view, half_deg, pixels) in [
        (View::Transverse, 80.0_f64, [640, 480]),
        (View::Transverse, 80.0, [300, 500]),
        (View::Transverse, 110.0, [400, 400]),
        (View::Sagittal, 80.0, [640, 480]),
        (View::Sagittal, 80.0, [200, 700]),
    ] {
        let mut plane = Plane { pixels, ..plane(view) };
        plane.probe.half_angle = half_deg.to_radians();
        let is_lit = |x: u32, y: u32| {
            let place_m = plane.place_of(Vector2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
            let at = plane.in_beams(place_m);
            at.across.abs() <= plane.probe.half(view) && (0.0..=plane.depth_m).contains(&at.depth_m)
        };
        let all = (0..pixels[1]).flat_map(|y| (0..pixels[0]).map(move |x| [x, y]));
        let lit: Vec<[u32; 2]> = all.filter(|[x, y]| is_lit(*x, *y)).collect();
        let [x, y, wide, high] = plane.covered();
        for (axis, from, size) in [(0, x, wide), (1, y, high)] {
            let least = lit.iter().map(|at| at[axis]).min().expect("lit");
            let most = lit.iter().map(|at| at[axis]).max().expect("lit");
            let end = from + size;
            assert!(
                from <= least && end > most,
                "{view:?} {half_deg} {axis}: {from} to {end} for {least} to {most}"
            );
            assert!(
                least - from <= 3 && end - most <= 4,
                "{view:?} {half_deg} {axis}: {from} to {end} for {least} to {most}"
            );
            assert!(end <= pixels[axis]);
        }
    }
}

#[test]
fn way_and_turn_match_the_stepper() {
    let base = Pose::of_tool(
        Vector3::new(0.01, 0.02, 0.03),
        &UnitQuaternion::from_euler_angles(0.3, -0.2, 0.5),
        &Probe::default(),
    );
    for (way_m, turn_rad) in [(5e-3, 0.4), (-60e-3, -1.5), (0.0, 0.0)] {
        let (way, turn) = base.moved(way_m, turn_rad).way_and_turn(&base);
        assert!(
            (way - way_m).abs() < 1e-12 && (turn - turn_rad).abs() < 1e-12,
            "{way} {turn}"
        );
    }
}
