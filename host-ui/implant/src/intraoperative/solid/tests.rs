//! An ellipsoid clicked at a few points is reproduced, by closed form.

use super::*;
use crate::intraoperative::agreement::Agreement;
use crate::plan::anatomy::ball;
use nalgebra::{Rotation3, Vector2, Vector3};
use std::f64::consts::PI;

/// Half axes: right, up and along the axis, m.
const HALF_M: [f64; 3] = [0.024, 0.018, 0.021];
const MIDDLE_M: [f64; 3] = [0.05, 0.04, 0.06];

fn straight() -> Transverse {
    Transverse {
        origin_m: Vector3::from(MIDDLE_M),
        right: Vector3::x(),
        up: Vector3::y(),
        along: Vector3::z(),
    }
}

/// Clicks points of the ellipsoid in planes along its axis, unevenly about it; the centre of its
/// planes moves by `sheared` along it.
fn clicked(planes_m: &[f64], points: usize, sheared: f64, error_m: f64) -> Contour {
    let mut contour = Contour::default();
    for (plane, at_m) in planes_m.iter().enumerate() {
        let share = (1.0 - (at_m / HALF_M[2]).powi(2)).sqrt();
        for n in 0..points {
            let uneven = 0.2 * ((plane * points + n) as f64 * 2.4).sin();
            let angle = (n as f64 + uneven) / points as f64 * 2.0 * PI;
            let off_m = error_m * ((plane * points + n) as f64 * 1.7).sin();
            let point = Vector2::new(angle.cos() * HALF_M[0], angle.sin() * HALF_M[1]) * share;
            let point = point + point.normalize() * off_m;
            contour = contour.with(*at_m, [point.x + sheared * at_m, point.y]);
        }
    }
    contour
}

const FIVE_M: [f64; 5] = [-0.016, -0.008, 0.0, 0.008, 0.016];

fn exact_m3() -> f64 {
    4.0 / 3.0 * PI * HALF_M[0] * HALF_M[1] * HALF_M[2]
}

#[test]
fn six_clicks_in_five_planes_of_an_ellipsoid_are_the_ellipsoid() {
    let solid = Solid::of(&clicked(&FIVE_M, 6, 0.0, 0.0)).expect("five planes");
    let body = solid.body(&straight(), "prostate").expect("closed");
    let of_form = Agreement::of(&body, &ball("ellipsoid", MIDDLE_M, HALF_M)).expect("two bodies");
    let volume = of_form.volumes_m3[0] / exact_m3() - 1.0;
    // Each corner by the closed form, without the facets of the ball.
    let radius = |p: &[f64; 3]| {
        let off = [0, 1, 2].map(|a| (p[a] - MIDDLE_M[a]) / HALF_M[a]);
        off.iter().map(|x| x * x).sum::<f64>().sqrt()
    };
    let worst = body
        .closed_surface()
        .0
        .iter()
        .map(|p| (radius(p) - 1.0).abs())
        .fold(0.0, f64::max);
    let poles = solid.poles_m();
    println!(
        "exact clicks: Dice {:.4}, mean distance {:.3} mm, Hausdorff {:.3} mm, volume {:+.2} %, corners within {:.2} % of the radius, \
         poles {:.2} and {:.2} mm",
        of_form.dice,
        of_form.mean_m * 1e3,
        of_form.hausdorff_m * 1e3,
        volume * 100.0,
        worst * 100.0,
        poles[0] * 1e3,
        poles[1] * 1e3
    );
    assert!(of_form.dice > 0.985, "{of_form:?}");
    assert!(of_form.mean_m < 0.15e-3 && of_form.hausdorff_m < 0.5e-3, "{of_form:?}");
    assert!(worst < 0.01, "{worst} of the radius");
    assert!(volume.abs() < 0.01, "{volume}");
    assert!(
        (poles[1] - HALF_M[2]).abs() < 1e-3 && (poles[0] + HALF_M[2]).abs() < 1e-3,
        "{poles:?}"
    );
}

#[test]
fn clicks_a_millimetre_off_cost_about_a_millimetre() {
    let solid = Solid::of(&clicked(&FIVE_M, 6, 0.0, 1e-3)).expect("five planes");
    let body = solid.body(&straight(), "prostate").expect("closed");
    let of_form = Agreement::of(&body, &ball("ellipsoid", MIDDLE_M, HALF_M)).expect("two bodies");
    println!(
        "clicks up to 1 mm off: {of_form:?}, volume {:+.2} %",
        (of_form.volumes_m3[0] / exact_m3() - 1.0) * 100.0
    );
    assert!(
        of_form.dice > 0.95 && of_form.mean_m < 1e-3 && of_form.hausdorff_m < 3e-3,
        "{of_form:?}"
    );
}

/// Compares the volume of a sheared ellipsoid with that of the ellipsoid (Cavalieri), in any
/// direction of the probe.
#[test]
fn an_oblique_gland_in_a_rotated_frame_keeps_its_volume() {
    let turned = Rotation3::from_euler_angles(0.4, -0.2, 0.9);
    let frame = Transverse {
        origin_m: Vector3::from(MIDDLE_M),
        right: turned * Vector3::x(),
        up: turned * Vector3::y(),
        along: turned * Vector3::z(),
    };
    let solid = Solid::of(&clicked(&FIVE_M, 6, 0.3, 0.0)).expect("five planes");
    let volume_m3 = solid
        .body(&frame, "prostate")
        .expect("closed")
        .structure(1e-3)
        .volume_m3();
    assert!((volume_m3 / exact_m3() - 1.0).abs() < 0.01, "{volume_m3}");
}

/// Compares a plane between two clicked ones with the closed form.
#[test]
fn a_plane_without_clicks_has_the_outline_of_the_ellipsoid() {
    let contour = clicked(&FIVE_M, 8, 0.0, 0.0);
    for at_m in [-0.019, -0.012, -0.003, 0.005, 0.0135, 0.0195] {
        let outline = proposed_at(&contour, at_m).expect("inside");
        let share = (1.0 - (at_m / HALF_M[2]).powi(2)).sqrt();
        let off_m = |p: Vector2<f64>| ((p.x / HALF_M[0]).hypot(p.y / HALF_M[1]) - share).abs() * HALF_M[1];
        let worst_m = outline.points_m().map(off_m).fold(0.0, f64::max);
        assert!(worst_m < 0.2e-3, "{worst_m} m at {at_m} m");
    }
    assert!(proposed_at(&contour, 0.0225).is_none(), "beyond the pole");
}

#[test]
fn with_few_planes_there_is_a_proposal_but_no_body() {
    let two = clicked(&[-5e-3, 5e-3], 6, 0.0, 0.0);
    assert_eq!(Solid::of(&two).err(), Some(ContourError(2)));
    let between = proposed_at(&two, 0.0).expect("a proposal");
    let beyond = proposed_at(&two, 0.02).expect("a proposal");
    let first = &two.outlines()[1].1;
    assert!((beyond.radii_m[0] - first.radii_m[0]).abs() < 1e-12);
    assert!((between.radii_m[0] - first.radii_m[0]).abs() < 1e-3);
    assert!(proposed_at(&Contour::default(), 0.0).is_none());
    // Two points are no outline.
    let little = two.with(0.0, [0.01, 0.0]).with(0.0, [0.0, 0.01]);
    assert_eq!(Solid::of(&little).err(), Some(ContourError(2)));
}

/// Tests outlines that do not shrink towards an end: the gland ends half a plane farther.
#[test]
fn a_gland_whose_last_plane_is_largest_is_closed() {
    let ring = |radius_m: f64| {
        (0..8).map(move |n| {
            let (sine, cosine) = (f64::from(n) / 8.0 * 2.0 * PI).sin_cos();
            [cosine * radius_m, sine * radius_m]
        })
    };
    let contour = [(-5e-3, 0.01), (0.0, 0.012), (5e-3, 0.016)]
        .into_iter()
        .fold(Contour::default(), |c, (at_m, r)| {
            c.with_all(at_m, &ring(r).collect::<Vec<_>>())
        });
    let solid = Solid::of(&contour).expect("three planes");
    assert!((solid.poles_m()[1] - 7.5e-3).abs() < 1e-9, "{:?}", solid.poles_m());
    assert!(solid.body(&straight(), "prostate").is_ok());
}
