//! The replay of a recorded hand.

use nalgebra::Vector3;
use stylet_hw::{
    Device, DeviceInfo, HandGoal, ReplayDevice, Sample, SimulatedPhantom, SimulatedPhantomConfig, conformance,
};

use crate::DT_S;

/// Samples of a moving hand.
fn recorded(count: usize) -> Vec<Sample> {
    let mut hand = SimulatedPhantom::new(SimulatedPhantomConfig::default());
    hand.set_hand_goal(&HandGoal {
        tip_in_world: Vector3::new(0.01, 0.0, 0.05),
        direction: Vector3::new(0.1, 0.0, 1.0),
        speed_m_per_s: 0.1,
        acceleration_m_per_s2: 2.0,
    });
    (0..count).map(|_| hand.read(DT_S).unwrap()).collect()
}

fn played(samples: Vec<Sample>) -> ReplayDevice {
    ReplayDevice::new(DeviceInfo::phantom_premium_1_5(), samples, DT_S).expect("usable")
}

#[test]
fn a_recorded_hand_meets_the_contract() {
    conformance::check(&mut played(recorded(500)));
}

#[test]
fn every_sample_is_played_once_and_the_last_one_repeats() {
    let samples = recorded(300);
    let mut device = played(samples.clone());
    let mut last = 0;
    for sample in &samples {
        let seen = device.read(DT_S).unwrap();
        assert_eq!(
            (seen.tip_in_world, seen.world_from_tool),
            (sample.tip_in_world, sample.world_from_tool)
        );
        assert!(seen.sequence > last, "a new sample has a new number");
        last = seen.sequence;
    }
    for _ in 0..50 {
        assert_eq!(
            device.read(DT_S).unwrap().sequence,
            last,
            "a number that stays reports silence"
        );
    }
}

#[test]
fn a_faster_loop_sees_each_sample_more_than_once() {
    let mut device = played(recorded(100));
    let numbers: Vec<u64> = (0..200).map(|_| device.read(DT_S / 2.0).unwrap().sequence).collect();
    assert_eq!((numbers[0], numbers[199]), (1, 100));
    assert!(numbers.windows(2).all(|n| n[1] == n[0] || n[1] == n[0] + 1));
}

#[test]
fn an_invalid_recording_is_refused() {
    let info = DeviceInfo::phantom_premium_1_5();
    let mut broken = recorded(3);
    broken[1].tip_in_world.y = f64::NAN;
    for (samples, period_s) in [
        (Vec::new(), DT_S),
        (broken, DT_S),
        (recorded(3), 0.0),
        (recorded(3), f64::NAN),
    ] {
        assert!(ReplayDevice::new(info, samples, period_s).is_none());
    }
}
