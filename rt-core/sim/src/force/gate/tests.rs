//! Claims about the gate, each against the words of its contract.

use super::*;

mod any_floats;

const DT_S: f64 = 1e-3;

fn device() -> DeviceInfo {
    DeviceInfo::phantom_premium_1_5()
}

fn still(wanted_n: Vector3<f64>) -> GateInput {
    GateInput {
        constant_n: Vector3::zeros(),
        wanted: Wrench::from_force(wanted_n),
        stored_j: 0.0,
        motion: Motion {
            moved_m: Vector3::zeros(),
            velocity_m_per_s: Vector3::zeros(),
            position_step_m: 3e-5,
            dt_s: DT_S,
        },
    }
}

/// Returns an engaged gate after its ramp, at zero force.
fn engaged(parameters: &GateParameters) -> GateState {
    let mut state = GateState::default();
    state.engage();
    run(
        parameters,
        &mut state,
        Vector3::zeros(),
        parameters.ramp_in_ticks as usize + 1,
    );
    state
}

fn full_scale() -> GateParameters {
    GateParameters {
        force_scale: 1.0,
        ..GateParameters::default()
    }
}

fn run(parameters: &GateParameters, state: &mut GateState, wanted_n: Vector3<f64>, ticks: usize) -> GateOutput {
    (0..ticks)
        .map(|_| step(parameters, &device(), state, &still(wanted_n)))
        .last()
        .unwrap()
}

fn noise(i: u32) -> f64 {
    f64::from(i.wrapping_mul(2_654_435_761) % 2001) / 1000.0 - 1.0
}

#[test]
fn defaults_are_valid_and_every_problem_is_listed() {
    assert_eq!(GateParameters::default().validate(), Ok(()));
    let broken = GateParameters {
        force_scale: f64::NAN,
        max_force_n: -1.0,
        ramp_out_ticks: 0,
        ..GateParameters::default()
    };
    let problems = broken.validate().unwrap_err();
    assert_eq!(problems.len(), 3);
    assert_eq!(problems[1].to_string(), "gate.max_force_n = -1: must be within 0 to 40");
}

#[test]
fn a_gate_that_was_not_engaged_gives_nothing() {
    let mut state = GateState::default();
    let out = run(&GateParameters::default(), &mut state, Vector3::new(5.0, 0.0, 0.0), 100);
    assert_eq!((out.wrench.force_n, out.engaged), (Vector3::zeros(), false));
}

#[test]
fn neither_magnitude_nor_slew_is_ever_exceeded() {
    let parameters = GateParameters::default();
    let mut state = GateState::default();
    let mut previous = Vector3::zeros();
    for i in 0..200_000u32 {
        match i % 5000 {
            // So small that it engages at once.
            0 => {
                state.engage();
                step(&parameters, &device(), &mut state, &still(Vector3::zeros()));
            }
            4000 => state.trip(ForceFault::Overrun),
            _ => {}
        }
        let size = if i % 7 == 0 { 1e200 } else { 20.0 };
        let wanted = Vector3::new(noise(i), noise(i / 3 + 77), noise(i / 11 + 5)) * size;
        let out = step(&parameters, &device(), &mut state, &still(wanted));
        assert!(out.wrench.force_n.norm() <= 8.5 + 1e-9, "magnitude in tick {i}");
        let change = (out.wrench.force_n - previous).norm();
        assert!(
            change <= parameters.slew_n_per_s * DT_S + 1e-9,
            "slew in tick {i}: {change}"
        );
        previous = out.wrench.force_n;
    }
    let counts = state.counts();
    assert!(counts.slew_limited > 0 && counts.magnitude_limited > 0);
    assert_eq!(counts.faults, 40);
}

#[test]
fn the_device_limit_holds_whatever_the_settings_say() {
    let parameters = GateParameters {
        max_force_n: f64::INFINITY,
        slew_n_per_s: f64::INFINITY,
        ramp_in_ticks: 0,
        ..GateParameters::default()
    };
    let mut state = engaged(&parameters);
    let out = run(&parameters, &mut state, Vector3::new(1e300, 1e300, 0.0), 3);
    assert!(out.wrench.force_n.norm() <= 8.5 + 1e-9);
    let nonsense = GateParameters {
        force_scale: f64::NAN,
        ..GateParameters::default()
    };
    let out = run(&nonsense, &mut state, Vector3::new(1.0, 0.0, 0.0), 1);
    assert!(out.wrench.force_n == Vector3::zeros() && out.fault == Some(ForceFault::NonFiniteForce));
}

#[test]
fn a_force_that_is_nan_ramps_to_zero_and_reports() {
    let parameters = full_scale();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut state = engaged(&parameters);
        let good = Vector3::new(0.0, 4.0, 0.0);
        run(&parameters, &mut state, good, 1000);
        let out = run(&parameters, &mut state, Vector3::new(bad, 0.0, 0.0), 1);
        assert_eq!(out.fault.map(ForceFault::code), Some(1));
        assert!(out.wrench.force_n.norm() < 4.0);
        let ticks = parameters.ramp_out_ticks as usize - 1;
        assert_eq!(
            run(&parameters, &mut state, good, ticks).wrench.force_n,
            Vector3::zeros()
        );
        // It latches.
        assert_eq!(
            run(&parameters, &mut state, good, 1000).wrench.force_n,
            Vector3::zeros()
        );
        // Engaged again it waits, as the force is not small; then it continues.
        state.engage();
        let waits = run(&parameters, &mut state, good, 1000);
        assert!(waits.fault.is_none() && !waits.engaged && waits.wrench.force_n == Vector3::zeros());
        run(&parameters, &mut state, Vector3::zeros(), 1);
        let again = run(&parameters, &mut state, good, 1000);
        assert!(again.engaged && (again.wrench.force_n - good).norm() < 1e-9);
    }
}

#[test]
fn engaging_waits_for_a_small_force_then_ramps_in() {
    let parameters = GateParameters {
        force_scale: 0.5,
        ..GateParameters::default()
    };
    let mut state = GateState::default();
    state.engage();
    // 1.1 N of the device is over the limit of 1 N, 0.9 N is not.
    let large = run(&parameters, &mut state, Vector3::new(0.0, 0.0, -2.2), 500);
    assert!(state.waiting() && large.wrench.force_n == Vector3::zeros());
    let mut previous = 0.0;
    for tick in 1..=parameters.ramp_in_ticks {
        let wanted = Vector3::new(0.0, 0.0, if tick == 1 { -1.8 } else { -6.0 });
        let size = run(&parameters, &mut state, wanted, 1).wrench.force_n.norm();
        assert!(size > previous && size - previous < 0.03, "tick {tick}: {size}");
        previous = size;
    }
    assert!((previous - 3.0).abs() < 1e-9);
}

#[test]
fn warm_motors_get_no_more_than_their_continuous_force() {
    let parameters = GateParameters {
        thermal_time_s: 10.0,
        ..full_scale()
    };
    let mut state = engaged(&parameters);
    let wanted = Vector3::new(6.0, 0.0, 0.0);
    let cold = run(&parameters, &mut state, wanted, 300).wrench.force_n.norm();
    assert!((cold - 6.0).abs() < 1e-9);
    let mut previous = state.output().force_n.norm();
    for _ in 0..100_000 {
        let size = run(&parameters, &mut state, wanted, 1).wrench.force_n.norm();
        // The slope of the limit: over a fifth of the heat, as fast as 6 N warm the motors.
        let steepest_n = 5.0 * (8.5 - 1.4) * (6.0 / 1.4f64).powi(2) * DT_S / parameters.thermal_time_s;
        assert!(
            previous - size < steepest_n,
            "drops by {} N in one tick",
            previous - size
        );
        previous = size;
    }
    assert!(state.warmth_n() <= 1.4 * 1.001);
    assert!(state.output().force_n.norm() < 1.6);
    assert!(state.counts().thermal_limited > 0);
}

#[test]
fn torque_keeps_its_own_limits() {
    let parameters = full_scale();
    let mut state = engaged(&parameters);
    let mut previous = Vector3::zeros();
    for i in 0..10_000u32 {
        let torque_nm = Vector3::new(noise(i / 50), noise(i / 70), noise(i / 90)) * 0.5;
        let input = GateInput {
            wanted: Wrench {
                force_n: Vector3::zeros(),
                torque_nm,
            },
            ..still(Vector3::zeros())
        };
        let out = step(&parameters, &device(), &mut state, &input).wrench.torque_nm;
        assert!(out.norm() <= 0.188 + 1e-12, "{out:?}");
        assert!(
            (out - previous).norm() <= 0.01 + 1e-12,
            "steps by {}",
            (out - previous).norm()
        );
        previous = out;
    }
    assert!(state.counts().torque_limited > 0);
    state.trip(ForceFault::Overrun);
    let ticks = parameters.ramp_out_ticks as usize;
    assert_eq!(
        run(&parameters, &mut state, Vector3::zeros(), ticks).wrench,
        Wrench::zero()
    );
}

#[test]
fn every_stage_counts_what_it_did() {
    let parameters = full_scale();
    let mut state = engaged(&parameters);
    let mut expected = [0; 8];
    assert_eq!(state.counts().all(), expected);
    // A jump of 2 N takes four ticks, three of them cut.
    run(&parameters, &mut state, Vector3::x() * 2.0, 4);
    expected[2] = 3;
    assert_eq!(state.counts().all(), expected);
    run(&parameters, &mut state, Vector3::x() * 8.4, 13);
    let before = state.counts().all();
    run(&parameters, &mut state, Vector3::x() * 9.0, 2);
    assert_eq!(state.counts().magnitude_limited - before[3], 2);
    // The hand is pushed 1 mm by 8.5 N that it never paid for.
    let mut given = still(Vector3::x() * 8.4);
    given.motion.moved_m = Vector3::x() * 1e-3;
    given.motion.velocity_m_per_s = Vector3::x() * 0.1;
    let out = step(&parameters, &device(), &mut state, &given);
    assert_eq!(state.counts().passivity, 1);
    assert!(out.wrench.force_n.x < 8.4, "damped");
    run(&parameters, &mut state, Vector3::x() * f64::NAN, 1);
    let all = state.counts().all();
    assert_eq!((all[0], all[7]), (1, 1));
}

/// A handle of 0.2 kg that is carried: 50 mm up are 88 mJ that the account must allow.
#[test]
fn a_constant_force_is_no_debt_and_what_is_beside_it_still_is() {
    let parameters = full_scale();
    let weight_n = Vector3::z() * 1.77;
    let lifted = |wanted_n: Vector3<f64>, by_m: f64| GateInput {
        constant_n: weight_n,
        motion: Motion {
            moved_m: Vector3::z() * by_m,
            velocity_m_per_s: Vector3::z() * (by_m / DT_S),
            ..still(wanted_n).motion
        },
        ..still(wanted_n)
    };
    let mut state = GateState::default();
    state.engage();
    for _ in 0..=parameters.ramp_in_ticks {
        step(&parameters, &device(), &mut state, &lifted(weight_n, 0.0));
    }
    assert!(!state.waiting(), "a weight that is carried is no reason to wait");
    for tick in 0..2000 {
        let by_m = if tick < 1000 { 5e-5 } else { -5e-5 };
        let out = step(&parameters, &device(), &mut state, &lifted(weight_n, by_m));
        assert!(
            (out.wrench.force_n - weight_n).norm() < 1e-9,
            "tick {tick}: {:?}",
            out.wrench.force_n
        );
    }
    assert_eq!(state.counts().passivity, 0);
    for _ in 0..1000 {
        step(
            &parameters,
            &device(),
            &mut state,
            &lifted(weight_n + Vector3::z() * 2.0, 5e-5),
        );
    }
    assert!(state.counts().passivity > 0, "2 N more give 100 mJ");
}
