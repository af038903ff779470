//! The device with its threads: poses for the force loop, forces for the motors, and the end.

use fake_drd::Block;
use fake_drd::control::{get, put};
use nalgebra::Vector3;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use stylet_heap as heap;
use stylet_hw::drd::ffi::status;
use stylet_hw::{ArmError, Device, DeviceFault, ForceDimension, Wrench, conformance};

use super::fake::{Fake, api, config};
use crate::driven::{LONG, drive, until};

fn push() -> Wrench {
    Wrench::from_force(Vector3::y())
}

/// Opens a device; returns it with the messages that it has reported so far.
fn open_listening() -> (ForceDimension, Arc<Mutex<Vec<String>>>) {
    let heard = Arc::new(Mutex::new(Vec::new()));
    let ear = Arc::clone(&heard);
    let report = Box::new(move |text: &str| ear.lock().unwrap().push(text.to_owned()));
    let device = ForceDimension::open(config(), Box::new(|| Ok("not armed".to_owned())), report);
    (device.expect("a device"), heard)
}

/// Returns whether the motors push up with this force. World +y is up, which this maker calls z.
fn feels(fake: &Fake, up_n: f64) -> bool {
    (fake.control.commanded_n()[2] - up_n).abs() < 1e-9
}

#[test]
fn the_device_meets_the_contract() {
    let fake = Fake::new();
    let mut device = fake.open();
    assert!(drive(&mut device, &Wrench::zero(), Result::is_ok));
    conformance::check(&mut device);
    assert!(until(LONG, || fake.control.commanded_n() == [0.0; 3]));
    let far_too_much = Wrench::from_force(Vector3::repeat(1e300));
    let size = || Vector3::from(fake.control.commanded_n()).norm();
    assert!(drive(&mut device, &far_too_much, |_| (size() - 12.0).abs() < 1e-9));
    assert_eq!(fake.control.non_finite_forces.load(Relaxed), 0);
    assert!(get(&fake.control.peak_force_n) <= 12.0 * (1.0 + 1e-9));
}

#[test]
fn pose_force_and_torque_change_frames_as_stated() {
    let fake = Fake::new();
    fake.control.system_type.store(104, Relaxed);
    let mut device = fake.open();
    // Towards the operator, to the right, up.
    for (cell, m) in fake.control.tip_m.iter().zip([-0.03, 0.01, 0.02]) {
        put(cell, m);
    }
    let there = Vector3::new(-0.01, 0.02, 0.03);
    fake.control.buttons.store(0b101, Relaxed);
    assert!(drive(&mut device, &Wrench::zero(), |s| {
        s.is_ok_and(|s| {
            (s.tip_in_world - there).norm() < 1e-12
                && (s.direction_in_world() - Vector3::z()).norm() < 1e-9
                && s.buttons == 0b101
        })
    }));
    // About y, to the operator's right: the tip, which points away, goes down with a positive angle.
    put(&fake.control.turn_rad, -0.1);
    assert!(drive(&mut device, &Wrench::zero(), |s| {
        s.is_ok_and(|s| (s.direction_in_world() - Vector3::new(0.0, -0.1_f64.sin(), 0.1_f64.cos())).norm() < 1e-9)
    }));
    let wrench = Wrench {
        force_n: Vector3::new(1.0, 2.0, 3.0),
        torque_nm: Vector3::new(0.01, 0.02, 0.03),
    };
    let near = |sent: [f64; 3], want: [f64; 3]| sent.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-12);
    assert!(drive(&mut device, &wrench, |_| near(
        fake.control.commanded_n(),
        [-3.0, -1.0, 2.0]
    ) && near(
        fake.control.commanded_nm(),
        [-0.03, -0.01, 0.02]
    )));
}

#[test]
fn a_device_without_motors_in_its_wrist_gets_no_torque() {
    let fake = Fake::new();
    let mut device = fake.open();
    let wrench = Wrench {
        torque_nm: Vector3::z(),
        ..push()
    };
    assert!(drive(&mut device, &wrench, |_| feels(&fake, 1.0)));
    assert_eq!(fake.control.commanded_nm(), [0.0; 3]);
    assert_eq!(device.info().peak_torque_nm, 0.0);
}

#[test]
fn the_watchdog_of_the_device_is_armed_before_its_forces_are_on() {
    let fake = Fake::new();
    let device = fake.open();
    let watchdog_s = device.description().watchdog_s.expect("armed");
    assert_eq!(watchdog_s, 0.02);
    assert_eq!(
        f64::from(fake.control.watchdog_units.load(Relaxed)) * 125e-6,
        watchdog_s
    );
    let order = fake.control.order();
    let first = |name| order.iter().position(|n| *n == name).expect("called");
    assert!(first("dhdSetWatchdog") < first("dhdEnableForce"), "{order:?}");
}

#[test]
fn a_hanging_call_is_named_and_the_device_drops_its_force() {
    let fake = Fake::new();
    let (mut device, heard) = open_listening();
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&fake, 1.0)));
    fake.control.hang.store(1, Relaxed);
    assert!(drive(&mut device, &push(), |s| *s == Err(DeviceFault::TimedOut)));
    let later_us = fake.control.commanded_us.load(Relaxed) + 20_001;
    assert_eq!(fake.control.motors_n(later_us), [0.0; 3]);
    assert!(until(LONG, || heard
        .lock()
        .unwrap()
        .iter()
        .any(|t| t.contains("does not return"))));
    let closes = fake.control.calls_of("dhdClose");
    std::thread::sleep(Duration::from_millis(50));
    assert_eq!(
        fake.control.calls_of("dhdClose"),
        closes,
        "no call but the one that hangs"
    );
    fake.control.hang.store(0, Relaxed);
    assert!(
        drive(&mut device, &push(), |s| s.is_ok() && feels(&fake, 1.0)),
        "it comes back"
    );
    assert_eq!(fake.control.overlapping.load(Relaxed), 0);
}

#[test]
fn a_device_that_hangs_for_ever_can_be_dropped() {
    let fake = Fake::new();
    let mut device = fake.open();
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&fake, 1.0)));
    fake.control.hang.store(1, Relaxed);
    assert!(drive(&mut device, &push(), Result::is_err));
    drop(device);
    fake.control.hang.store(0, Relaxed);
    // The abandoned thread returns, leaves zero force and ends, without closing its device.
    assert!(until(LONG, || fake.control.commanded_n() == [0.0; 3]));
    let ticks = fake.control.calls_of("dhdSetForceAndTorqueAndGripperForce");
    std::thread::sleep(Duration::from_millis(50));
    assert!(fake.control.calls_of("dhdSetForceAndTorqueAndGripperForce") <= ticks + 1);
}

#[test]
fn a_replugged_device_needs_no_reload_of_the_library() {
    let fake = Fake::new();
    let (mut device, heard) = open_listening();
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&fake, 1.0)));
    fake.control.unplugged.store(1, Relaxed);
    assert!(drive(&mut device, &push(), |s| *s == Err(DeviceFault::NotConnected)));
    assert!(until(LONG, || heard
        .lock()
        .unwrap()
        .iter()
        .any(|t| t.contains("USB cable"))));
    assert!(
        until(LONG, || fake.control.calls_of("dhdOpenID") > 3),
        "it goes on looking"
    );
    fake.control.unplugged.store(0, Relaxed);
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&fake, 1.0)));
    assert_eq!(fake.control.opens.load(Relaxed), 2);
    let reported = heard.lock().unwrap().clone();
    assert!(
        reported.windows(2).all(|pair| pair[0] != pair[1]),
        "no message twice in a row: {reported:#?}"
    );
}

#[test]
fn another_model_is_refused_after_a_reconnection() {
    let fake = Fake::new();
    let (mut device, heard) = open_listening();
    assert!(drive(&mut device, &push(), Result::is_ok));
    fake.control.unplugged.store(1, Relaxed);
    assert!(drive(&mut device, &push(), Result::is_err));
    fake.control.system_type.store(63, Relaxed);
    fake.control.unplugged.store(0, Relaxed);
    assert!(until(LONG, || heard
        .lock()
        .unwrap()
        .iter()
        .any(|t| t.contains("in place of"))));
    assert!(device.read(1e-3).is_err());
    assert_eq!(device.info().peak_force_n, 12.0);
}

#[test]
fn a_device_that_is_not_calibrated_waits_for_the_operator() {
    let fake = Fake::new();
    fake.control.status(status::RESET, 1);
    let (mut device, heard) = open_listening();
    assert_eq!(device.read(1e-3), Err(DeviceFault::NotCalibrated));
    assert!(heard.lock().unwrap()[0].contains("calibrate"));
    assert_eq!(fake.control.calls_of("dhdEnableForce"), 0);
    fake.control.status_place.store(0, Relaxed);
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&fake, 1.0)));
}

#[test]
fn a_stale_force_is_released() {
    let fake = Fake::new();
    let mut device = fake.open();
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&fake, 1.0)));
    assert!(until(LONG, || feels(&fake, 0.0)), "the force loop has stopped");
    // The force goes out first, the fault is reported at the end of the same tick.
    assert!(until(LONG, || device.read(1e-3) == Err(DeviceFault::TimedOut)));
    assert!(
        drive(&mut device, &push(), |s| s.is_ok() && feels(&fake, 1.0)),
        "and goes on"
    );
}

#[test]
fn a_dropped_device_is_zeroed_stopped_and_closed_in_order() {
    let fake = Fake::new();
    let mut device = fake.open();
    let strong = Wrench::from_force(Vector3::y() * 8.0);
    assert!(drive(&mut device, &strong, |_| feels(&fake, 8.0)));
    drop(device);
    assert_eq!(get(&fake.control.force_at_stop_n), 0.0);
    assert_eq!(fake.control.commanded_n(), [0.0; 3]);
    let calls = ["dhdStop", "dhdClose"].map(|name| fake.control.calls_of(name));
    assert_eq!(calls, [1, 1]);
}

#[test]
fn a_servo_thread_that_could_not_be_armed_exerts_no_force() {
    let fake = Fake::new();
    let refused = ForceDimension::open(config(), Box::new(|| Err(ArmError::new("no rights"))), Box::new(|_| ()));
    assert!(refused.map(drop).unwrap_err().to_string().contains("no rights"));
    assert_eq!(fake.control.force_mode.load(Relaxed), 0);
    let first = AtomicBool::new(true);
    let arm = move || match first.swap(false, Relaxed) {
        true => Ok("armed".to_owned()),
        false => Err(ArmError::new("no rights")),
    };
    let mut device = ForceDimension::open(config(), Box::new(arm), Box::new(|_| ())).expect("a device");
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&fake, 1.0)));
    fake.control.unplugged.store(1, Relaxed);
    assert!(drive(&mut device, &push(), Result::is_err));
    fake.control.reset();
    assert!(drive(&mut device, &push(), |s| {
        assert!(s.is_err());
        assert_eq!(fake.control.commanded_n(), [0.0; 3]);
        fake.control.opens.load(Relaxed) > 1
    }));
}

/// Most heap calls of the servo thread, counted in its query for the buttons.
static MOST: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);
static ASKED: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);
static LAST: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);

unsafe extern "system" fn counted_buttons(_id: core::ffi::c_char) -> u32 {
    let calls = heap::calls_of_this_thread();
    if ASKED.fetch_add(1, Relaxed) > 0 {
        MOST.fetch_max(calls - LAST.load(Relaxed), Relaxed);
    }
    LAST.store(calls, Relaxed);
    0
}

#[test]
fn the_servo_thread_makes_no_heap_call() {
    let _fake = Fake::new();
    let mut api = api();
    api.dhdGetButtonMask = counted_buttons;
    let arm = Box::new(|| Ok("not armed".to_owned()));
    let mut device = ForceDimension::open_with(api, config(), arm, Box::new(|_| ())).expect("a device");
    assert!(drive(&mut device, &push(), |_| ASKED.load(Relaxed) > 1000));
    assert_eq!(MOST.load(Relaxed), 0);
}
