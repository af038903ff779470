//! Claims about the gate, each against the words of its contract.

use super::*;

const DT_S: f64 = 1e-3;

fn device() -> DeviceInfo {
    DeviceInfo::phantom_premium_1_5()
}

fn run(parameters: &GateParameters, state: &mut GateState, wanted_n: Vector3<f64>, ticks: usize) -> GateOutput {
    (0..ticks)
        .map(|_| step(parameters, &device(), state, &wanted_n, DT_S))
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
    assert_eq!((out.force_n, out.engaged), (Vector3::zeros(), false));
}

#[test]
fn neither_magnitude_nor_slew_is_ever_exceeded() {
    let parameters = GateParameters::default();
    let mut state = GateState::default();
    let mut previous = Vector3::zeros();
    for i in 0..200_000u32 {
        match i % 5000 {
            0 => state.engage(),
            4000 => state.trip(ForceFault::Overrun),
            _ => {}
        }
        let size = if i % 7 == 0 { 1e200 } else { 20.0 };
        let wanted = Vector3::new(noise(i), noise(i / 3 + 77), noise(i / 11 + 5)) * size;
        let out = step(&parameters, &device(), &mut state, &wanted, DT_S);
        assert!(out.force_n.norm() <= 8.5 + 1e-9, "magnitude in tick {i}");
        let change = (out.force_n - previous).norm();
        assert!(
            change <= parameters.slew_n_per_s * DT_S + 1e-9,
            "slew in tick {i}: {change}"
        );
        previous = out.force_n;
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
    let mut state = GateState::default();
    state.engage();
    let out = run(&parameters, &mut state, Vector3::new(1e300, 1e300, 0.0), 3);
    assert!(out.force_n.norm() <= 8.5 + 1e-9);
    let nonsense = GateParameters {
        force_scale: f64::NAN,
        ..GateParameters::default()
    };
    let out = run(&nonsense, &mut state, Vector3::new(1.0, 0.0, 0.0), 1);
    assert!(out.force_n == Vector3::zeros() && out.fault == Some(ForceFault::NonFiniteForce));
}

#[test]
fn a_force_that_is_no_number_leads_to_zero_within_the_ramp_and_says_so() {
    let parameters = GateParameters::default();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut state = GateState::default();
        state.engage();
        let good = Vector3::new(0.0, 4.0, 0.0);
        run(&parameters, &mut state, good, 1000);
        let out = run(&parameters, &mut state, Vector3::new(bad, 0.0, 0.0), 1);
        assert_eq!(out.fault.map(ForceFault::code), Some(1));
        assert!(out.force_n.norm() < 4.0);
        let ticks = parameters.ramp_out_ticks as usize - 1;
        assert_eq!(run(&parameters, &mut state, good, ticks).force_n, Vector3::zeros());
        // It latches.
        assert_eq!(run(&parameters, &mut state, good, 1000).force_n, Vector3::zeros());
        state.engage();
        let again = run(&parameters, &mut state, good, 1000);
        assert!(again.fault.is_none() && (again.force_n - good).norm() < 1e-9);
    }
}

#[test]
fn engaging_ramps_in_and_the_scale_applies() {
    let parameters = GateParameters {
        force_scale: 0.5,
        ..GateParameters::default()
    };
    let mut state = GateState::default();
    state.engage();
    let wanted = Vector3::new(0.0, 0.0, -6.0);
    let mut previous = 0.0;
    for _ in 0..parameters.ramp_in_ticks {
        let size = run(&parameters, &mut state, wanted, 1).force_n.norm();
        assert!(size > previous && size - previous < 0.02);
        previous = size;
    }
    assert!((previous - 3.0).abs() < 1e-9);
}

#[test]
fn warm_motors_get_no_more_than_their_continuous_force() {
    let parameters = GateParameters {
        thermal_time_s: 10.0,
        ..GateParameters::default()
    };
    let mut state = GateState::default();
    state.engage();
    let wanted = Vector3::new(6.0, 0.0, 0.0);
    let cold = run(&parameters, &mut state, wanted, 300).force_n.norm();
    assert!((cold - 6.0).abs() < 1e-9);
    run(&parameters, &mut state, wanted, 100_000);
    assert!(state.warmth_n() <= 1.4 * 1.001);
    assert!(state.output_n().norm() < 1.6);
    assert!(state.counts().thermal_limited > 0);
}
