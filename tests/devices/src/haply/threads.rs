//! The device with its threads: poses for the force loop, messages for the service, and the end.

use fake_haply::{Server, Service, Wrong};
use nalgebra::Vector3;
use std::sync::{Arc, Mutex};
use stylet_hw::{ArmError, Axes, Device, DeviceFault, Haply, HaplyConfig, Placement, Sample, Wrench, conformance};

use crate::driven::{LONG, drive, until};

pub fn config(server: &Server) -> HaplyConfig {
    HaplyConfig {
        service: server.url().parse().expect("an address"),
        wanted: Default::default(),
        placement: Placement::facing_patient(Axes::HAPLY, Vector3::zeros()),
        servo_hz: 1000,
    }
}

pub fn open(server: &Server) -> Haply {
    open_listening(server).0
}

/// Opens a device; returns it with the messages that it has reported so far.
fn open_listening(server: &Server) -> (Haply, Arc<Mutex<Vec<String>>>) {
    let heard = Arc::new(Mutex::new(Vec::new()));
    let ear = Arc::clone(&heard);
    let report = Box::new(move |text: &str| ear.lock().unwrap().push(text.to_owned()));
    let device = Haply::open(config(server), Box::new(|| Ok("not armed".to_owned())), report);
    (device.expect("a device"), heard)
}

/// Returns the reason why the device does not open, in words.
pub fn refused(config: HaplyConfig) -> String {
    let opened = Haply::open(config, Box::new(|| Ok(String::new())), Box::new(|_| ()));
    opened.map(drop).expect_err("refused").to_string()
}

fn push() -> Wrench {
    Wrench::from_force(Vector3::y())
}

/// Returns whether the device pushes up with this force. World +y is up, which this maker calls z.
fn feels(service: &Service, up_n: f64) -> bool {
    (service.state().force_n[2] - up_n).abs() < 1e-9
}

#[test]
fn the_device_meets_the_contract() {
    let service = Service::default();
    let server = Server::start(&service);
    let mut device = open(&server);
    assert!(drive(&mut device, &Wrench::zero(), Result::is_ok));
    conformance::check(&mut device);
    assert!(until(LONG, || service.state().force_n == [0.0; 3]));
    let far_too_much = Wrench::from_force(Vector3::repeat(1e300));
    let size = || Vector3::from(service.state().force_n).norm();
    assert!(drive(&mut device, &far_too_much, |_| (size() - 2.0).abs() < 1e-6));
    let state = service.state();
    assert!(state.peak_n <= 2.0 * (1.0 + 1e-9), "{}", state.peak_n);
    assert_eq!((state.wrong_messages, state.out_of_turn), (0, 0));
}

#[test]
fn pose_and_force_change_frames_and_torque_is_dropped() {
    let service = Service::default();
    let server = Server::start(&service);
    let mut device = open(&server);
    // To the right, forward, up.
    service.state().tip_m = [0.01, 0.03, 0.02];
    let there = Vector3::new(-0.01, 0.02, 0.03);
    assert!(drive(&mut device, &Wrench::zero(), |s| {
        s.is_ok_and(|s| {
            (s.tip_in_world - there).norm() < 1e-12 && (s.direction_in_world() - Vector3::z()).norm() < 1e-9
        })
    }));
    let wrench = Wrench {
        force_n: Vector3::new(0.1, 0.2, 0.3),
        torque_nm: Vector3::repeat(0.1),
    };
    let near = |sent: [f64; 3]| (Vector3::from(sent) - Vector3::new(-0.1, 0.3, 0.2)).norm() < 1e-8;
    assert!(drive(&mut device, &wrench, |_| near(service.state().force_n)));
    assert_eq!(device.info().peak_torque_nm, 0.0);
}

#[test]
fn a_grip_turns_the_needle_relative_to_its_first_orientation() {
    let service = Service::default();
    let half = 0.5_f64.sqrt();
    service.state().grip = Some([half, 0.0, 0.0, half]);
    let server = Server::start(&service);
    let mut device = open(&server);
    let points = |s: &Result<Sample, DeviceFault>, to: Vector3<f64>| {
        s.is_ok_and(|s| (s.direction_in_world() - to).norm() < 1e-9)
    };
    assert!(drive(&mut device, &Wrench::zero(), |s| points(s, Vector3::z())));
    // A turn about the axis to the operator's right by 0.2 rad lifts the tip, which points forward.
    let (sin, cos) = 0.1_f64.sin_cos();
    service.state().grip = Some([cos * half, sin * half, -sin * half, cos * half]);
    service.state().buttons = [true, true];
    let up = Vector3::new(0.0, 0.2_f64.sin(), 0.2_f64.cos());
    assert!(drive(&mut device, &Wrench::zero(), |s| points(s, up)
        && s.is_ok_and(|s| s.buttons == 0b101)));
    service.state().grip = None;
    let sequence = device.read(1e-3).expect("a sample").sequence;
    assert!(drive(&mut device, &Wrench::zero(), |s| s
        .is_ok_and(|s| s.sequence > sequence + 20)));
    assert!(points(&device.read(1e-3), up));
}

#[test]
fn a_silent_service_gets_a_zero_and_is_reconnected() {
    let service = Service::default();
    let server = Server::start(&service);
    let (mut device, heard) = open_listening(&server);
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&service, 1.0)));
    service.state().wrong = Wrong::Silent;
    assert!(drive(&mut device, &push(), |s| *s == Err(DeviceFault::TimedOut)));
    assert!(drive(&mut device, &push(), |_| feels(&service, 0.0)));
    let named = |text: &str| heard.lock().unwrap().iter().any(|t| t.contains(text));
    assert!(until(LONG, || named("does not answer")));
    service.state().wrong = Wrong::Nothing;
    assert!(
        drive(&mut device, &push(), |s| s.is_ok() && feels(&service, 1.0)),
        "it comes back"
    );
    assert_eq!(service.state().out_of_turn, 0);
}

#[test]
fn no_fault_of_the_service_ends_the_threads() {
    let service = Service::default();
    let server = Server::start(&service);
    let mut device = open(&server);
    let kinds = (0..6).map(Wrong::Broken).chain((0..5).map(Wrong::NoNumber));
    let others = [
        Wrong::Far,
        Wrong::Binary,
        Wrong::Long,
        Wrong::Closes,
        Wrong::Hangs,
        Wrong::Late(60),
        Wrong::Old,
        Wrong::NotReady,
    ];
    for wrong in kinds.chain(others) {
        assert!(
            drive(&mut device, &push(), |s| s.is_ok() && feels(&service, 1.0)),
            "before {wrong:?}"
        );
        service.state().wrong = wrong;
        assert!(drive(&mut device, &push(), Result::is_err), "{wrong:?}");
        service.state().wrong = Wrong::Nothing;
        assert!(
            drive(&mut device, &push(), |_| feels(&service, 0.0)),
            "{wrong:?} left a force"
        );
    }
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&service, 1.0)));
    assert_eq!(service.state().out_of_turn, 0);
}

#[test]
fn unsolicited_answers_do_not_delay_the_pose() {
    let service = Service::default();
    let server = Server::start(&service);
    let mut device = open(&server);
    service.state().wrong = Wrong::Twice;
    let messages = service.state().messages + 500;
    assert!(drive(&mut device, &Wrench::zero(), |_| service.state().messages > messages));
    service.state().tip_m[2] = 0.05;
    let before = service.state().messages;
    assert!(drive(&mut device, &Wrench::zero(), |s| s.is_ok_and(|s| (s
        .tip_in_world
        .y
        - 0.05)
        .abs()
        < 1e-9)));
    let taken = service.state().messages - before;
    assert!(taken < 250, "{taken} exchanges until the new pose: a queue");
}

#[test]
fn a_flooding_service_is_disconnected_and_named() {
    let service = Service::default();
    let server = Server::start(&service);
    let (mut device, heard) = open_listening(&server);
    let named = |text: &str| heard.lock().unwrap().iter().any(|t| t.contains(text));
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&service, 1.0)));
    service.state().wrong = Wrong::Floods;
    assert!(drive(&mut device, &push(), |s| s.is_err()));
    assert!(until(LONG, || named("sends unsolicited messages")
        && service.state().force_n == [0.0; 3]));
    service.state().wrong = Wrong::Nothing;
    assert!(drive(&mut device, &Wrench::zero(), Result::is_ok));
}

#[test]
fn another_device_is_refused_after_replugging() {
    let service = Service::default();
    let server = Server::start(&service);
    let (mut device, heard) = open_listening(&server);
    let named = |text: &str| heard.lock().unwrap().iter().any(|t| t.contains(text));
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&service, 1.0)));
    service.state().wrong = Wrong::Unplugged;
    assert!(drive(&mut device, &push(), |s| *s == Err(DeviceFault::NotConnected)));
    assert!(until(LONG, || named("unplugged or switched off")));
    service.state().wrong = Wrong::Other;
    assert!(until(LONG, || named("0BAD is in its place")));
    assert!(device.read(1e-3).is_err());
    service.state().wrong = Wrong::Nothing;
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&service, 1.0)));
    let reported = heard.lock().unwrap().clone();
    assert!(
        reported.windows(2).all(|pair| pair[0] != pair[1]),
        "no message twice in a row: {reported:#?}"
    );
}

#[test]
fn a_stale_force_is_released() {
    let service = Service::default();
    let server = Server::start(&service);
    let mut device = open(&server);
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&service, 1.0)));
    assert!(until(LONG, || feels(&service, 0.0)), "the force loop has stopped");
    // The force goes out first, the fault is reported at the end of the same tick.
    assert!(until(LONG, || device.read(1e-3) == Err(DeviceFault::TimedOut)));
    assert!(
        drive(&mut device, &push(), |s| s.is_ok() && feels(&service, 1.0)),
        "and goes on"
    );
}

#[test]
fn a_dropped_device_leaves_zero_force_before_it_closes() {
    let service = Service::default();
    let server = Server::start(&service);
    let mut device = open(&server);
    assert!(drive(&mut device, &push(), |_| feels(&service, 1.0)));
    service.state().force_at_close_n = [9.0; 3];
    drop(device);
    assert!(until(LONG, || service.state().force_at_close_n == [0.0; 3]));
}

#[test]
fn a_device_whose_service_hangs_for_ever_can_be_dropped() {
    let service = Service::default();
    let server = Server::start(&service);
    let mut device = open(&server);
    assert!(drive(&mut device, &push(), |s| s.is_ok() && feels(&service, 1.0)));
    service.state().wrong = Wrong::Hangs;
    assert!(drive(&mut device, &push(), Result::is_err));
    drop(device);
}

#[test]
fn a_servo_thread_that_could_not_be_armed_exerts_no_force() {
    let service = Service::default();
    let server = Server::start(&service);
    let arm = Box::new(|| Err(ArmError::new("no rights")));
    let opened = Haply::open(config(&server), arm, Box::new(|_| ()));
    assert!(opened.map(drop).expect_err("refused").to_string().contains("no rights"));
    assert_eq!(service.state().peak_n, 0.0);
}
