//! Signs, sizes and limits of each term of the force law.

use super::*;
use crate::needle::NeedleParameters;
use stylet_hw::DeviceInfo;

fn input(depth_m: f64, punctured: bool, phase: Phase) -> ForceInput {
    let path_direction = Vector3::z();
    ForceInput {
        tip_in_world: path_direction * depth_m,
        velocity_m_per_s: Vector3::zeros(),
        path_origin_in_world: Vector3::zeros(),
        path_direction,
        depth_m,
        puncture_depth_m: NeedleParameters::default().puncture_depth_m,
        phase,
        punctured,
    }
}

fn fresh(input: &ForceInput) -> ForceTerms {
    force(&ForceParameters::default(), &mut ForceState::default(), input)
}

#[test]
fn defaults_can_be_rendered_by_the_phantom() {
    let device = DeviceInfo::phantom_premium_1_5();
    let needle = NeedleParameters::default();
    assert_eq!(ForceParameters::default().validate_for(&needle, &device), Ok(()));
    let stiff = ForceParameters {
        membrane_peak_n: 8.0,
        guide_gain: 3.0,
        damping_n_s_per_m: f64::NAN,
        ..ForceParameters::default()
    };
    let problems = stiff.validate_for(&needle, &device).unwrap_err();
    assert_eq!(problems.len(), 3, "{problems:?}");
}

#[test]
fn outside_there_is_no_force_but_the_weight() {
    let mut outside = input(-0.01, false, Phase::Outside);
    outside.velocity_m_per_s = Vector3::new(0.1, 0.2, 0.3);
    assert_eq!(fresh(&outside).total_n, Vector3::zeros());
    let parameters = ForceParameters {
        compensated_mass_kg: 0.1,
        ..ForceParameters::default()
    };
    let terms = force(&parameters, &mut ForceState::default(), &outside);
    assert!((terms.total_n - Vector3::new(0.0, 0.0, 0.981)).norm() < 1e-12);
}

#[test]
fn the_membrane_pushes_out_most_at_the_critical_depth_and_then_lets_go() {
    let parameters = ForceParameters::default();
    let critical = NeedleParameters::default().puncture_depth_m;
    let mut previous = 0.0;
    for i in 1..=100 {
        let depth = critical * f64::from(i) / 100.0;
        let push = -fresh(&input(depth, false, Phase::Contraction)).total_n.z;
        assert!(push > previous);
        previous = push;
    }
    assert!((previous - parameters.membrane_peak_n).abs() < 1e-12);
    let after = fresh(&input(critical, true, Phase::Penetration));
    assert_eq!(after.membrane_n, Vector3::zeros());
    let expected = parameters.cutting_force_n + parameters.shaft_friction_n_per_m * critical;
    assert!((after.total_n.z + expected).abs() < 1e-9, "{}", after.total_n.z);
    assert!(expected < 0.5 * parameters.membrane_peak_n, "the drop must be felt");
}

#[test]
fn contact_force_never_pulls_the_tip_in() {
    for speed in [-0.3, -0.1, -0.01, 0.0, 0.01, 0.3] {
        for i in 1..=80 {
            let mut at = input(f64::from(i) * 1e-4, false, Phase::Contraction);
            at.velocity_m_per_s = Vector3::new(0.05, -0.02, speed);
            assert!(fresh(&at).total_n.z <= 1e-12, "pulls at {speed} m/s");
        }
    }
}

#[test]
fn guide_points_to_the_path_and_never_along_it() {
    let mut at = input(0.02, true, Phase::Hold);
    at.path_direction = Vector3::new(1.0, 2.0, -2.0) * 7.0;
    at.tip_in_world = Vector3::new(0.003, -0.004, 0.02);
    let axis = at.path_direction.normalize();
    let offset = at.tip_in_world - axis * axis.dot(&at.tip_in_world);
    let guide = fresh(&at).guide_n;
    assert!(guide.dot(&axis).abs() < 1e-12);
    assert!((guide + offset * 400.0).norm() < 1e-12);
    at.punctured = false;
    assert_eq!(fresh(&at).guide_n, Vector3::zeros());
}

#[test]
fn friction_and_damping_oppose_motion_both_ways_and_grow_with_depth() {
    let parameters = ForceParameters::default();
    let mut state = ForceState::default();
    let mut sizes = Vec::new();
    for (from, to, phase) in [(0.008, 0.048, Phase::Penetration), (0.048, 0.008, Phase::Retraction)] {
        for i in 0..=1000 {
            let depth = from + (to - from) * f64::from(i) / 1000.0;
            let mut at = input(depth, true, phase);
            at.velocity_m_per_s = Vector3::z() * (to - from);
            let terms = force(&parameters, &mut state, &at);
            assert!(terms.damping_n.dot(&at.velocity_m_per_s) < 0.0);
            assert_eq!(terms.membrane_n, Vector3::zeros());
            // On reversal the stuck shaft first gives back what its spring holds.
            let reversing = phase == Phase::Retraction && from - depth < 0.012;
            if !reversing {
                assert!(terms.friction_n.dot(&at.velocity_m_per_s) < 0.0, "{phase:?} {depth}");
            }
            sizes.push((depth, terms.friction_n.z, terms.total_n.norm()));
        }
    }
    let deepest = sizes.iter().find(|(depth, ..)| *depth >= 0.048).unwrap();
    assert!((deepest.1 + 1.5 + 80.0 * 0.048).abs() < 1e-9);
    assert!(sizes.iter().all(|(.., total)| *total < 8.5));
}

#[test]
fn a_tip_at_rest_feels_the_same_force_for_ever() {
    let mut state = ForceState::default();
    let parameters = ForceParameters::default();
    let at = input(0.03, true, Phase::Hold);
    let first = force(&parameters, &mut state, &at);
    for _ in 0..100_000 {
        assert!((force(&parameters, &mut state, &at).total_n - first.total_n).norm() < 1e-9);
    }
}

#[test]
fn what_is_no_number_reaches_the_gate() {
    for phase in [Phase::Outside, Phase::Contraction, Phase::Penetration] {
        for punctured in [false, true] {
            let mut bad = input(0.004, punctured, phase);
            bad.velocity_m_per_s.x = f64::NAN;
            assert!(fresh(&bad).total_n.x.is_nan(), "{phase:?}");
            let mut bad = input(f64::NAN, punctured, phase);
            bad.tip_in_world = Vector3::repeat(f64::NAN);
            let total = fresh(&bad).total_n;
            assert!(total.iter().any(|x| x.is_nan()), "{phase:?} {total:?}");
        }
    }
}
