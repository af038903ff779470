//! The simulated Phantom against closed forms of mass, spring, dry friction and amplifier.

use nalgebra::Vector3;
use stylet_hw::{
    BadLink, Device, DeviceFault, Hand, LinkFaults, SimulatedPhantom, SimulatedPhantomConfig, Wrench, conformance,
};

use crate::DT_S;

fn config(hand: Hand) -> SimulatedPhantomConfig {
    SimulatedPhantomConfig {
        hand,
        ..SimulatedPhantomConfig::default()
    }
}

fn frictionless(hand: Hand) -> SimulatedPhantom {
    SimulatedPhantom::new(SimulatedPhantomConfig {
        coulomb_friction_n: 0.0,
        ..config(hand)
    })
}

fn push(device: &mut SimulatedPhantom, force_n: Vector3<f64>) {
    device.write(&Wrench::from_force(force_n)).unwrap();
}

#[test]
fn the_phantom_meets_the_contract_in_any_hand() {
    for hand in [Hand::passive(), Hand::steady(), Hand::absent()] {
        conformance::check(&mut SimulatedPhantom::new(config(hand)));
    }
}

#[test]
fn a_step_of_force_gives_the_response_of_mass_spring_and_damper() {
    let hand = Hand::passive();
    let mut device = frictionless(hand);
    let (m, b, k) = (0.075 + hand.mass_kg, hand.damping_n_s_per_m, hand.stiffness_n_per_m);
    let force_n = 3.0;
    push(&mut device, Vector3::x() * force_n);
    let decay = b / (2.0 * m);
    let omega = (k / m - decay * decay).sqrt();
    for tick in 1..=2000 {
        device.read(DT_S).unwrap();
        let t = f64::from(tick) * DT_S;
        let swing = (omega * t).cos() + decay / omega * (omega * t).sin();
        let expected = force_n / k * (1.0 - (-decay * t).exp() * swing);
        let error = (device.true_tip_in_world().x - expected).abs();
        assert!(error < 0.01 * force_n / k, "{error} m off at {t} s");
    }
}

#[test]
fn friction_reduces_the_acceleration_of_a_free_device() {
    let mut device = SimulatedPhantom::new(config(Hand::absent()));
    push(&mut device, Vector3::y());
    for _ in 0..100 {
        device.read(DT_S).unwrap();
    }
    let expected = (1.0 - 0.04) / 0.075 * 0.1;
    assert!((device.true_velocity_m_per_s().y - expected).abs() < 1e-9);
}

#[test]
fn friction_holds_the_device_and_stops_a_slide_in_finite_time() {
    let mut device = SimulatedPhantom::new(config(Hand::absent()));
    for tick in 0..10_000 {
        let angle = f64::from(tick);
        push(&mut device, Vector3::new(angle.sin(), angle.cos(), 0.0) * 0.0399);
        device.read(DT_S).unwrap();
        assert_eq!(*device.true_tip_in_world(), Vector3::zeros());
    }
    push(&mut device, Vector3::x());
    device.read(0.01).unwrap();
    push(&mut device, Vector3::zeros());
    let speed = device.true_velocity_m_per_s().x;
    let stop_s = speed * 0.075 / 0.04;
    let ticks = (stop_s / DT_S).ceil() as usize + 1;
    for _ in 0..ticks {
        device.read(DT_S).unwrap();
    }
    assert_eq!(*device.true_velocity_m_per_s(), Vector3::zeros());
    let stopped = *device.true_tip_in_world();
    device.read(DT_S).unwrap();
    assert_eq!(*device.true_tip_in_world(), stopped);
}

#[test]
fn positions_come_in_encoder_steps() {
    let mut device = SimulatedPhantom::new(config(Hand::passive()));
    for tick in 0..1000 {
        let t = f64::from(tick) * 0.01;
        push(&mut device, Vector3::new(t.sin(), t.cos(), 1.0) * 2.0);
        let shown = device.read(DT_S).unwrap().tip_in_world;
        let counts = shown / 3e-5;
        assert!((counts - counts.map(f64::round)).amax() < 1e-6);
        assert!((shown - device.true_tip_in_world()).amax() <= 1.5e-5 + 1e-12);
    }
}

#[test]
fn the_amplifier_keeps_the_direction_and_stops_at_its_peak() {
    let mut device = SimulatedPhantom::new(config(Hand::passive()));
    for size in [1.0, 8.5, 8.6, 100.0, 1e300] {
        let asked = Vector3::new(2.0, -1.0, 2.0) / 3.0;
        push(&mut device, asked * size);
        let given = device.applied_wrench().force_n;
        assert!((given - asked * f64::min(size, 8.5)).norm() < 1e-9, "{size}");
    }
    let wrench = Wrench {
        force_n: Vector3::zeros(),
        torque_nm: Vector3::new(0.0, 1.0, 0.0),
    };
    device.write(&wrench).unwrap();
    assert!((device.applied_wrench().torque_nm.y - 0.188).abs() < 1e-12);
    let nonsense = Wrench::from_force(Vector3::repeat(f64::NAN));
    assert!(device.write(&nonsense).is_err());
    assert_eq!(*device.applied_wrench(), Wrench::zero());
}

#[test]
fn a_hand_with_no_goal_gives_no_energy() {
    let mut device = SimulatedPhantom::new(config(Hand::passive()));
    push(&mut device, Vector3::new(5.0, -3.0, 1.0));
    for _ in 0..50 {
        device.read(DT_S).unwrap();
    }
    push(&mut device, Vector3::zeros());
    let mut energy = device.energy_j();
    assert!(energy > 1e-3);
    for _ in 0..5000 {
        device.read(DT_S).unwrap();
        assert!(device.energy_j() <= energy * (1.0 + 1e-12));
        energy = device.energy_j();
    }
    // Dry friction may hold it a little off its rest: k x < Fc.
    assert!(device.true_tip_in_world().norm() <= 0.04 / 300.0 + 1e-9);
}

#[test]
fn every_hand_is_stable_against_a_sampled_wall() {
    for mass_kg in [0.1, 1.0] {
        for damping_n_s_per_m in [2.0, 20.0] {
            for stiffness_n_per_m in [50.0, 1000.0] {
                let hand = Hand {
                    mass_kg,
                    damping_n_s_per_m,
                    stiffness_n_per_m,
                    effort: None,
                };
                let mut device = SimulatedPhantom::new(config(hand));
                let stiffness = device.info().max_stiffness_n_per_m;
                let mut late = 0.0f64;
                for tick in 0..20_000 {
                    let tip = device.read(DT_S).unwrap().tip_in_world;
                    let kick = if tick < 20 { 8.0 } else { 0.0 };
                    push(&mut device, Vector3::x() * kick - tip * stiffness);
                    if tick > 15_000 {
                        late = late.max(device.true_velocity_m_per_s().norm());
                    }
                }
                assert!(
                    late < 1e-3,
                    "{mass_kg} kg, {damping_n_s_per_m} N s/m, {stiffness_n_per_m} N/m: {late} m/s"
                );
            }
        }
    }
}

#[test]
fn invalid_periods_are_refused_or_shortened() {
    let mut device = SimulatedPhantom::new(config(Hand::passive()));
    for bad in [f64::NAN, -1e-3, f64::INFINITY] {
        assert_eq!(device.read(bad), Err(DeviceFault::InvalidPeriod));
    }
    let first = device.read(DT_S).unwrap();
    assert_eq!(device.read(0.0).unwrap(), first, "no time, no new sample");
    let late = device.read(1e9).unwrap();
    assert!(late.sequence == first.sequence + 1 && late.is_finite());
}

#[test]
fn a_bad_link_delays_loses_and_repeats_as_asked() {
    let faults = LinkFaults {
        late_ticks: 2,
        ..LinkFaults::default()
    };
    let phantom = || SimulatedPhantom::new(config(Hand::passive()));
    let mut late = BadLink::new(phantom(), faults);
    for tick in 0..10 {
        late.write(&Wrench::from_force(Vector3::x() * f64::from(tick))).unwrap();
        let arrived = late.device.applied_wrench().force_n.x;
        assert_eq!(arrived, f64::from((tick - 2).max(0)));
    }
    let faults = LinkFaults {
        lost_per_thousand: 100,
        repeated_per_thousand: 50,
        ..LinkFaults::default()
    };
    let mut bad = BadLink::new(phantom(), faults);
    let (mut lost, mut repeated, mut sequence) = (0, 0, 0);
    for tick in 1..=10_000 {
        let sample = bad.read(DT_S).unwrap();
        repeated += u32::from(sample.sequence == sequence);
        sequence = sample.sequence;
        let wrench = Wrench::from_force(Vector3::x() * (1e-4 * f64::from(tick)));
        bad.write(&wrench).unwrap();
        lost += u32::from(*bad.device.applied_wrench() != wrench);
    }
    assert!(
        (900..1100).contains(&lost) && (400..600).contains(&repeated),
        "{lost} {repeated}"
    );
    conformance::check(&mut BadLink::new(phantom(), LinkFaults::default()));
}

#[test]
fn the_work_of_a_force_equals_the_energy_gained() {
    let hand = Hand {
        damping_n_s_per_m: 0.0,
        ..Hand::passive()
    };
    let mut device = frictionless(hand);
    push(&mut device, Vector3::new(2.0, -1.0, 0.5));
    for _ in 0..20 {
        device.read(DT_S).unwrap();
    }
    // The implicit step damps a little.
    let (work, energy) = (device.work_j(), device.energy_j());
    assert!(
        energy > 1e-3 && (work - energy).abs() < 0.02 * work,
        "{work} J in, {energy} J there"
    );
}
