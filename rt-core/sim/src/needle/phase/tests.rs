//! Eq. 6 against values worked out by hand, and its properties over extreme input.

use super::*;

fn input(depth_m: f64, speed_along: f64, tip_step_m: f64) -> NeedleInput {
    NeedleInput {
        depth_m,
        speed_along_m_per_s: speed_along,
        speed_m_per_s: speed_along.abs(),
        tip_step_m: Vector3::z() * tip_step_m,
    }
}

#[test]
fn defaults_are_valid_and_every_problem_is_listed() {
    assert_eq!(NeedleParameters::default().validate(), Ok(()));
    let broken = NeedleParameters {
        puncture_depth_m: f64::NAN,
        depth_coefficient_m2: 0.0,
        retraction_ratio: 1.5,
        ..NeedleParameters::default()
    };
    let keys: Vec<_> = broken.validate().unwrap_err().iter().map(|p| p.key).collect();
    assert_eq!(
        keys,
        [
            "needle.puncture_depth_m",
            "needle.depth_coefficient_m2",
            "needle.retraction_ratio"
        ]
    );
}

#[test]
fn eq_6_gives_the_values_worked_out_by_hand() {
    let p = NeedleParameters {
        puncture_depth_m: 0.004,
        speed_coefficient_m2_per_s2: 0.01,
        depth_coefficient_m2: 1e-4,
        static_speed_m_per_s: 0.02,
        ..NeedleParameters::default()
    };
    // (speed, depth, exponent): (0.12-0.02)^2/0.01 = 1; (0.014-0.004)^2/1e-4 = 1; both; (0.07-0.02)^2/0.01 = 0.25
    for (speed, depth, exponent) in [
        (0.02, 0.004, 0.0),
        (0.01, 0.004, 0.0),
        (0.12, 0.004, 1.0),
        (0.02, 0.014, 1.0),
        (0.12, 0.014, 2.0),
        (0.07, 0.024, 4.25),
    ] {
        let got = transmission(Phase::Penetration, speed, depth, &p);
        assert!((got - f64::exp(-exponent)).abs() < 1e-12, "{speed} {depth}");
    }
    assert_eq!(transmission(Phase::Contraction, 0.3, 0.001, &p), 1.0);
    assert_eq!(transmission(Phase::Retraction, 0.3, 0.02, &p), 0.3);
    assert_eq!(transmission(Phase::Outside, 0.3, -0.1, &p), 0.0);
}

#[test]
fn transmission_is_a_ratio_and_falls_with_speed_and_depth() {
    let p = NeedleParameters::default();
    let extremes = [
        -1e300,
        -1.0,
        0.0,
        1e-300,
        1e-9,
        0.004,
        0.008,
        0.02,
        1.0,
        1e150,
        f64::MAX,
    ];
    for (i, &speed) in extremes.iter().enumerate() {
        for (j, &depth) in extremes.iter().enumerate() {
            let ratio = transmission(Phase::Penetration, speed, depth, &p);
            assert!((0.0..=1.0).contains(&ratio), "{speed} {depth}: {ratio}");
            if let Some(&faster) = extremes.get(i + 1) {
                assert!(transmission(Phase::Penetration, faster, depth, &p) <= ratio);
            }
            if let Some(&deeper) = extremes.get(j + 1) {
                assert!(transmission(Phase::Penetration, speed, deeper, &p) <= ratio);
            }
        }
    }
    for bad in [f64::NAN, f64::INFINITY] {
        assert!(transmission(Phase::Penetration, bad, 0.01, &p).is_finite());
        assert!(transmission(Phase::Penetration, 0.01, bad, &p).is_finite());
    }
}

#[test]
fn an_insertion_goes_through_its_phases_and_punctures_once() {
    let p = NeedleParameters::default();
    let mut state = NeedleState::default();
    let mut seen = vec![Phase::Outside];
    let mut punctures = 0;
    let mut depth = -0.005;
    for tick in 0..3000 {
        let speed = if tick < 1000 {
            0.03
        } else if tick < 1200 {
            0.0
        } else {
            -0.03
        };
        depth += speed * 1e-3;
        let out = step(&p, &mut state, &input(depth, speed, speed * 1e-3));
        punctures += u32::from(out.puncture);
        if seen.last() != Some(&out.phase) {
            seen.push(out.phase);
        }
    }
    use Phase::*;
    assert_eq!(seen, [Outside, Contraction, Penetration, Hold, Retraction, Outside]);
    assert_eq!((punctures, state.punctures, state.punctured), (1, 1, false));
}

#[test]
fn trembling_at_the_critical_depth_is_one_puncture() {
    let p = NeedleParameters::default();
    let mut state = NeedleState::default();
    for i in 0..10_000 {
        let depth = p.puncture_depth_m + 3e-5 * f64::from(i).sin();
        step(&p, &mut state, &input(depth, 0.01, 1e-5));
    }
    assert_eq!(state.punctures, 1);
}

#[test]
fn a_membrane_that_was_not_punctured_comes_back_with_the_tip() {
    let p = NeedleParameters::default();
    let mut state = NeedleState::default();
    let (mut depth, mut held) = (0.001, 0.0);
    for i in 0..10_000 {
        let speed = if i % 200 < 100 { 0.02 } else { -0.02 };
        depth += speed * 1e-3;
        held += step(&p, &mut state, &input(depth, speed, speed * 1e-3)).held_step_m.z;
    }
    assert!(held.abs() < 1e-9, "the membrane creeps by {held} m");
}

#[test]
fn holding_and_nonsense_move_nothing() {
    let p = NeedleParameters::default();
    let mut state = NeedleState {
        punctured: true,
        ..NeedleState::default()
    };
    let out = step(&p, &mut state, &input(0.02, 0.0, 0.0));
    assert_eq!((out.phase, out.held_step_m), (Phase::Hold, Vector3::zeros()));
    for bad in [
        input(f64::NAN, 0.1, 1e-3),
        input(0.1, f64::INFINITY, 1e-3),
        input(0.01, 0.1, f64::NAN),
    ] {
        let out = step(&p, &mut state, &bad);
        assert_eq!(
            (out.held_step_m, out.transmission, out.puncture),
            (Vector3::zeros(), 0.0, false)
        );
        assert!(state.punctured);
    }
}
