//! The hard cases of force and needle, each with its figure: underflow, rest, quantisation, bad samples.

use crate::rig::Rig;
use stylet_benches::session::Tick;
use stylet_hw::{Hand, LinkFaults};
use stylet_sim::needle::{LayerKind, NeedleInput, NeedleParameters, NeedleState, Phase, step, transmission};

const GLAND: &[(f64, LayerKind)] = &[(0.0, LayerKind::Gland)];

fn inserted(hand: Hand, faults: LinkFaults) -> Rig {
    let mut rig = Rig::new(Hand::steady(), faults, GLAND, 1e-3);
    rig.go_to(0.045, 0.05);
    rig.run(2.0);
    rig.device.device.set_hand(hand);
    rig
}

/// Case 9.
#[test]
fn edges_of_eq_6_are_values_not_accidents() {
    let p = NeedleParameters::default();
    let at = |speed: f64, depth: f64, p: &NeedleParameters| transmission(Phase::Penetration, speed, depth, p);
    assert_eq!(
        at(p.static_speed_m_per_s, p.puncture_depth_m, &p),
        1.0,
        "|v| = V0, u = u_cri"
    );
    let steep = NeedleParameters {
        depth_coefficient_m2: 1e-10,
        speed_coefficient_m2_per_s2: 1e-6,
        ..p
    };
    assert_eq!(
        at(0.28, 0.05, &steep),
        0.0,
        "an exponent of 70000 is no motion, not a subnormal"
    );
    assert!(at(p.static_speed_m_per_s, p.puncture_depth_m + 1e-12, &steep) > 0.999);
    let mut state = NeedleState::default();
    let input = NeedleInput {
        depth_m: p.puncture_depth_m,
        speed_along_m_per_s: p.static_speed_m_per_s,
        speed_m_per_s: p.static_speed_m_per_s,
        tip_step_m: nalgebra::Vector3::z() * 1e-5,
    };
    let out = step(&p, &mut state, &input);
    assert_eq!(
        (out.puncture, out.transmission, state.punctures),
        (true, 1.0, 1),
        "u = u_cri exactly"
    );
    assert!(!step(&p, &mut state, &input).puncture, "once");
}

/// Case 10.
#[test]
fn a_needle_at_rest_neither_chatters_nor_drifts_for_a_minute() {
    let mut rig = inserted(Hand::passive(), LinkFaults::default());
    rig.run(1.0);
    let before_m = rig.run(0.001)[0].true_tip_m;
    // A hand that trembles by 0.3 mm at 8 Hz, then rests.
    let mut ticks = Vec::new();
    for half in 0..960 {
        let way_m = if half % 2 == 0 { 3e-4 } else { -3e-4 };
        rig.go_to(0.045 + way_m, 0.02);
        ticks.extend(rig.run(0.0625));
    }
    rig.go_to(0.045, 0.02);
    let rest = rig.run(2.0);
    let drift_m = rest[rest.len() - 1].true_tip_m - before_m;
    let (low, high) = span(&ticks, |t| t.true_tip_m);
    let (weak, strong) = span(&ticks[1000..], |t| t.output.wrench.force_n.z);
    let fastest = rest[1000..].iter().map(|t| t.true_speed_m_per_s).fold(0.0, f64::max);
    println!(
        "60 s of tremor: tip within {:.3} mm, force within {:.3} N, drift {:.4} mm; at rest {fastest:.1e} m/s",
        (high - low) * 1e3,
        strong - weak,
        drift_m * 1e3
    );
    assert!(drift_m.abs() < 3e-5, "drifts by {drift_m} m");
    assert!(high - low < 3e-4, "the tip gives way more than the hand trembles");
    assert!(fastest < 1e-3, "{fastest} m/s at rest");
}

fn span(ticks: &[Tick], of: impl Fn(&Tick) -> f64) -> (f64, f64) {
    let low = ticks.iter().map(&of).fold(f64::MAX, f64::min);
    (low, ticks.iter().map(&of).fold(f64::MIN, f64::max))
}

/// Case 10, the other half: reversal.
#[test]
fn on_reversal_friction_turns_within_a_millimetre() {
    let mut rig = inserted(Hand::steady(), LinkFaults::default());
    rig.run(0.5);
    let deepest = rig.run(0.001)[0].true_tip_m;
    rig.go_to(0.0, 0.02);
    let ticks = rig.run(1.0);
    let backwards = |t: &&Tick| t.output.terms.friction_n.z > 0.0;
    let turned = ticks.iter().find(backwards).expect("friction opposes the way out");
    let way_m = deepest - turned.true_tip_m;
    println!("friction turns {:.2} mm after the needle", way_m * 1e3);
    assert!(way_m < 1e-3, "after {way_m} m");
    // A hand that stops pushing feels no further spring-back.
    for (who, hand) in [("passive hand", Hand::passive()), ("device alone", Hand::absent())] {
        let mut rig = inserted(Hand::steady(), LinkFaults::default());
        let before_m = rig.run(0.001)[0].true_tip_m;
        rig.go_to(before_m, 1.0);
        rig.device.device.set_hand(hand);
        let (low_m, _) = span(&rig.run(2.0), |t| t.true_tip_m);
        let recoil_m = before_m - low_m;
        println!("recoil at 45 mm, {who}: {:.2} mm", recoil_m * 1e3);
        assert!(
            hand == Hand::absent() || recoil_m < 1.5e-3,
            "springs back by {recoil_m} m"
        );
    }
}

/// Case 11.
#[test]
fn quantised_positions_give_nearly_the_force_of_exact_ones() {
    let session = |step_m: f64| {
        let mut rig = Rig::with_position_step(step_m, GLAND);
        rig.go_to(0.04, 0.048);
        let forces: Vec<f64> = rig.run(1.5).iter().map(|t| t.output.wrench.force_n.z).collect();
        forces
    };
    let (coarse, fine) = (session(3e-5), session(1e-7));
    let errors: Vec<f64> = coarse.iter().zip(&fine).map(|(a, b)| a - b).collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let jump = coarse.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
    println!("encoder of 0.03 mm: force differs by RMS {rms:.3} N; largest step {jump:.3} N");
    assert!(rms < 0.15, "{rms} N");
    assert!(jump <= 0.5 + 1e-9);
}

/// Case 12; the device and the gate refuse samples that are not numbers (`gate_tests.rs`, `hw/tests`).
#[test]
fn late_lost_and_repeated_samples_neither_sing_nor_kick() {
    for (late_ticks, per_thousand) in [(0, 100), (1, 100), (2, 100), (0, 300)] {
        let faults = LinkFaults {
            late_ticks,
            lost_per_thousand: per_thousand,
            repeated_per_thousand: per_thousand,
        };
        let mut rig = inserted(Hand::passive(), faults);
        rig.go_to(0.03, 0.1);
        let mut ticks = rig.run(0.5);
        rig.go_to(0.05, 0.1);
        ticks.extend(rig.run(3.0));
        let fastest = ticks[2500..].iter().map(|t| t.true_speed_m_per_s).fold(0.0, f64::max);
        let force = |t: &Tick| t.output.wrench.force_n;
        let jump = ticks
            .windows(2)
            .map(|w| (force(&w[1]) - force(&w[0])).norm())
            .fold(0.0, f64::max);
        let percent = per_thousand / 10;
        println!("{late_ticks} late, {percent} % lost, {percent} % repeated: {fastest:.2e} m/s, step {jump:.3} N");
        assert!(fastest < 3e-3 && jump <= 0.5 + 1e-9, "{fastest} m/s, {jump} N");
    }
}
