//! Signs, sizes and limits of each term of the force law.

use super::*;
use crate::needle::{LayerKind, Layers};
use stylet_device::DeviceInfo;
use stylet_settings::ParameterSet;

/// Returns the input for a needle in the gland alone.
fn input(depth_m: f64, punctured: bool, phase: Phase) -> ForceInput {
    let path_direction = Vector3::z();
    let gland = Layers::default().of(LayerKind::Gland);
    let shaft_m = if punctured { depth_m.max(0.0) } else { 0.0 };
    ForceInput {
        tip_in_world: path_direction * depth_m,
        velocity_m_per_s: Vector3::zeros(),
        needle_direction: path_direction,
        path_origin_in_world: Vector3::zeros(),
        path_direction,
        along_m: depth_m,
        depth_m,
        membrane: gland,
        tissue: gland,
        shaft_friction_n: gland.shaft_friction_n_per_m * shaft_m,
        phase,
        punctured,
        guided: punctured,
        answer: None,
    }
}

fn fresh(input: &ForceInput) -> ForceTerms {
    force(&ForceParameters::default(), &mut ForceState::default(), input)
}

#[test]
fn defaults_can_be_rendered_by_the_phantom_and_their_scale_fits() {
    let device = DeviceInfo::phantom_premium_1_5();
    let defaults = ForceParameters::default();
    assert_eq!(defaults.validate(), Ok(()));
    // 8.5 N of the device for the 9 N of the skin.
    let puncture_forces_n = defaults.layers.0.iter().map(|layer| layer.puncture_force_n);
    let fitting = device.peak_force_n / (puncture_forces_n.fold(0.0, f64::max) * defaults.membrane_gain);
    assert!((fitting - 8.5 / 9.0).abs() < 1e-12 && defaults.gate.force_scale <= fitting);
    assert_eq!(ParameterSet::default().problems_on(device.max_stiffness_n_per_m), []);
    let broken = ForceParameters {
        guide_gain: -1.0,
        damping_n_s_per_m: f64::NAN,
        ..defaults
    };
    let problems = broken.validate().unwrap_err();
    assert_eq!(problems.len(), 2, "{problems:?}");
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
fn the_membrane_pushes_most_at_the_critical_depth() {
    let parameters = ForceParameters::default();
    let gland = parameters.layers.of(LayerKind::Gland);
    let critical = gland.puncture_depth_m;
    let mut previous = 0.0;
    for i in 1..=100 {
        let depth = critical * f64::from(i) / 100.0;
        let push = -fresh(&input(depth, false, Phase::Contraction)).total_n.z;
        assert!(push > previous);
        previous = push;
    }
    assert!((previous - gland.puncture_force_n).abs() < 1e-12);
    let after = fresh(&input(critical, true, Phase::Penetration));
    assert_eq!(after.membrane_n, Vector3::zeros());
    let expected = gland.cutting_force_n + gland.shaft_friction_n_per_m * critical;
    assert!((after.total_n.z + expected).abs() < 1e-9, "{}", after.total_n.z);
    assert!(expected < 0.5 * gland.puncture_force_n, "the drop must be felt");
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
    at.guided = false;
    assert_eq!(fresh(&at).guide_n, Vector3::zeros());
}

#[test]
fn the_guide_torque_is_a_spring_of_the_angle() {
    let parameters = ForceParameters::default();
    for angle in [-0.3, -0.01, 0.0, 0.01, 0.3] {
        let mut at = input(0.02, true, Phase::Hold);
        at.needle_direction = nalgebra::Rotation3::from_axis_angle(&Vector3::x_axis(), angle) * Vector3::z();
        let torque = fresh(&at).torque_nm;
        // Minus the slope of k (1 - cos angle), finite difference.
        let energy = |a: f64| parameters.guide_torque_nm_per_rad * (1.0 - a.cos());
        let slope = (energy(angle + 1e-6) - energy(angle - 1e-6)) / 2e-6;
        assert!((torque.x + slope).abs() < 1e-6, "{angle} rad: {torque:?}");
        assert_eq!((torque.y, torque.z), (0.0, 0.0));
        at.guided = false;
        assert_eq!(fresh(&at).torque_nm, Vector3::zeros());
    }
}

#[test]
fn each_term_is_off_at_gain_zero_and_the_rest_stays() {
    let moving = |punctured| {
        let mut at = input(0.006, punctured, Phase::Penetration);
        at.tip_in_world.x = 1e-3;
        at.velocity_m_per_s = Vector3::z() * 0.01;
        at
    };
    type Change = fn(&mut ForceParameters);
    let with = |change: Change| {
        let mut parameters = ForceParameters {
            compensated_mass_kg: 0.05,
            ..ForceParameters::default()
        };
        change(&mut parameters);
        let before = force(&parameters, &mut ForceState::default(), &moving(false));
        let after = force(&parameters, &mut ForceState::default(), &moving(true));
        let sizes = [
            before.membrane_n,
            after.guide_n,
            after.damping_n,
            after.friction_n,
            after.gravity_n,
            after.torque_nm,
        ];
        sizes.map(|v| v.norm())
    };
    let all = with(|_| {});
    let cases: [(usize, Change); 5] = [
        (0, |p| p.membrane_gain = 0.0),
        (1, |p| p.guide_gain = 0.0),
        (2, |p| p.damping_n_s_per_m = 0.0),
        (3, |p| (p.shaft_gain, p.cutting_gain) = (0.0, 0.0)),
        (4, |p| p.compensated_mass_kg = 0.0),
    ];
    for (off, change) in cases {
        let sizes = with(change);
        for (term, (size, full)) in sizes.iter().zip(all).enumerate() {
            let expected = if term == off { 0.0 } else { full };
            assert!((size - expected).abs() < 1e-12, "term {term} with {off} off: {size}");
        }
        assert!(off == 5 || all[off] > 0.0);
    }
}

#[test]
fn coupled_tissue_replaces_membrane_and_friction_only() {
    let coupled = ForceParameters {
        coupling: 1.0,
        ..ForceParameters::default()
    };
    let mut at = input(0.02, true, Phase::Penetration);
    at.tip_in_world.x = 2e-3;
    at.velocity_m_per_s = Vector3::z() * 0.02;
    at.answer = Some(TissueForce {
        along_n: -3.0,
        stored_j: 6e-3,
    });
    let terms = force(&coupled, &mut ForceState::default(), &at);
    let alone = fresh(&at);
    assert_eq!(
        (terms.membrane_n, terms.friction_n),
        (Vector3::zeros(), Vector3::zeros())
    );
    assert_eq!((terms.guide_n, terms.damping_n), (alone.guide_n, alone.damping_n));
    assert_eq!(terms.tissue_n, Vector3::z() * -3.0);
    // What the tissue holds, and the guide's spring.
    assert!(
        (terms.stored_j - 6e-3 - 0.5 * 400.0 * 2e-3 * 2e-3).abs() < 1e-12,
        "{}",
        terms.stored_j
    );
    // Without an answer eq. 8-10 stand.
    at.answer = None;
    assert_eq!(force(&coupled, &mut ForceState::default(), &at).total_n, alone.total_n);
}

#[test]
fn friction_and_damping_oppose_motion_both_ways() {
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
            // On reversal the stuck shaft first gives back what its spring holds, within a millimetre.
            let reversing = phase == Phase::Retraction && from - depth < 1e-3;
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
