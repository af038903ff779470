//! Claims about which settings are valid.

use super::*;

#[test]
fn the_paper_s_settings_are_valid() {
    assert!(TissueParameters::default().validate().is_ok());
}

#[test]
fn every_problem_is_listed_at_once() {
    let parameters = TissueParameters {
        min_stretch: f64::NAN,
        max_stretch: 0.5,
        shear_deg: 45.0,
        shear_vert_deg: 45.0,
        recovery_time_s: 0.0,
        residual_tolerance: f64::INFINITY,
    };
    let problems = parameters.validate().expect_err("five problems");
    let names: Vec<_> = problems.iter().map(|problem| problem.key).collect();
    let expected = [
        "min_stretch",
        "max_stretch",
        "shear_deg, shear_vert_deg",
        "recovery_time_s",
        "residual_tolerance",
    ];
    assert_eq!(names, expected);
    assert_eq!(
        problems[1].to_string(),
        "max_stretch = 0.5: must be from 1 to 100 (1 forbids extension)"
    );
}

#[test]
fn folding_is_the_sign_of_the_smallest_corner() {
    // Oracle: the least determinant over all signs of all six shears.
    let mut random = stylet_random::Random(5);
    for _ in 0..2000 {
        let angles = [(); 3].map(|()| 60.0 * random.unit());
        let t = angles.map(|angle: f64| angle.to_radians().tan());
        let least = (0..64).map(|signs| {
            let a = |n: usize, axis: usize| if signs >> n & 1 == 0 { t[axis] } else { -t[axis] };
            let m = nalgebra::Matrix3::new(1.0, a(0, 0), a(1, 0), a(2, 1), 1.0, a(3, 1), a(4, 2), a(5, 2), 1.0);
            m.determinant()
        });
        let least = least.fold(f64::INFINITY, f64::min);
        assert!(
            (least - (1.0 - folding(angles))).abs() < 1e-9 * (1.0 + least.abs()),
            "{angles:?}"
        );
    }
}

#[test]
fn angles_beyond_folding_are_refused() {
    let with = |shear_deg, shear_vert_deg| TissueParameters {
        shear_deg,
        shear_vert_deg,
        ..TissueParameters::default()
    };
    for (shear, vert, ok) in [
        (26.565, 26.565, true),
        (26.566, 26.566, false),
        (0.0, 44.999, true),
        (0.0, 45.001, false),
        // Eq. 1 in a plane allows this one.
        (30.0, 59.99, false),
        (60.0, 12.0, true),
        (60.0, 13.0, false),
    ] {
        let result = with(shear, vert).validate();
        assert_eq!(result.is_ok(), ok, "{shear}, {vert}");
        if let Err(problems) = result {
            assert!(problems[0].to_string().contains("eq. 1 in three dimensions"));
        }
    }
}
