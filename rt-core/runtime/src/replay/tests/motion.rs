//! Motions that lapse, continue or are given up are repeated as recorded.

use super::*;
use crate::rt::motion_lease::Promise;

#[test]
fn a_flight_in_which_hosts_fall_silent_repeats_bit_by_bit() {
    let mut run = Recorded::new(TissueKind::Fem, &ForceParameters::default());
    let promise = Promise::first(7);
    let to = |run: &mut Recorded, depth_m: f64| {
        let goal = HandGoal {
            tip_in_world: run.entry_m + Vector3::z() * depth_m,
            direction: Vector3::z(),
            speed_m_per_s: 0.02,
            acceleration_m_per_s2: 1.0,
        };
        run.haptic(HapticOrder::Hand {
            goal,
            up: None,
            promise: Some(promise),
        });
    };
    run.haptic(HapticOrder::Engage);
    run.give_line(1);
    run.run(0.1);
    to(&mut run, 5e-3);
    // Lapses, resumes in the last tick of the grace or later, and is given up.
    for pause_s in [0.01, 0.02, 0.1, 0.3, 0.03, 0.4] {
        run.haptic(HapticOrder::KeepMoving(promise));
        run.run(pause_s);
    }
    to(&mut run, 6e-3);
    for _ in 0..60 {
        run.haptic(HapticOrder::KeepMoving(promise));
        run.run(0.02);
    }
    let flight = run.flight();
    assert_eq!(run.heap_calls, 0, "heap calls of the loops");
    let haptic = flight.haptic.as_ref().expect("recorded");
    let renewed = haptic
        .orders
        .iter()
        .filter(|(_, order)| matches!(order, HapticOrder::KeepMoving(_)));
    assert!(renewed.count() > 60);
    assert_identical(&flight);
    // Without the renewals the motion differs, and the recorded device disagrees with the leases.
    let mut other = flight.clone();
    let haptic = other.haptic.as_mut().expect("recorded");
    haptic
        .orders
        .retain(|(_, order)| !matches!(order, HapticOrder::KeepMoving(_)));
    let found = repeat::haptic(&other, other.haptic.as_ref().expect("recorded")).expect("can be run");
    assert!(found.different > 0, "{found:?}");
}
