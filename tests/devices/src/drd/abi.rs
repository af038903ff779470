//! Every function of the interface: name, types, and a call through the fake.

use fake_drd::table::{COUNT, ERRORS, FUNCTIONS, STATUS, Source};
use std::sync::atomic::Ordering::Relaxed;
use stylet_hw::LoadFailure;
use stylet_hw::drd::errors::{self, Response};
use stylet_hw::drd::ffi::{self, SIGNATURES};
use stylet_hw::drd::{Api, ForceDimension, OpenError, diagnose};
use stylet_hw::{DeviceFault, Severity};

use super::fake::{Fake, api, config, library, library_without};
use crate::driven::drive;

/// Returns the Rust type that a C type has on 64-bit Linux.
fn in_rust(c: &str) -> &str {
    match c {
        "char" => "Id",
        "int" => "c_int",
        "uint" => "c_uint",
        "uchar" => "c_uchar",
        "double" => "c_double",
        "bool" => "bool",
        "const char*" => "*const c_char",
        "int*" => "*mut c_int",
        "ushort*" => "*mut c_ushort",
        "uchar*" => "*mut c_uchar",
        "double*" => "*mut c_double",
        "double(*)[3]" => "*mut [c_double; 3]",
        other => panic!("{other}"),
    }
}

/// Returns the Rust signature of a C declaration, without spaces.
fn signature(c: &str) -> String {
    let (result, arguments) = c.split_once(" (").expect("result and arguments");
    let arguments = arguments.trim_end_matches(')').split(", ").filter(|a| !a.is_empty());
    let arguments: Vec<_> = arguments.map(in_rust).collect();
    let result = match result {
        "void" => String::new(),
        other => format!("->{}", in_rust(other)),
    };
    format!("({}){result}", arguments.join(",")).replace(' ', "")
}

#[test]
fn every_function_has_its_published_name_and_types() {
    assert_eq!(SIGNATURES.len(), COUNT);
    for ((name, types), published) in SIGNATURES.iter().zip(FUNCTIONS) {
        println!("{:38} {:?}: {}", published.name, published.source, published.c);
        assert_eq!(*name, published.name, "the names, typed twice");
        assert_eq!(types.replace([' ', '\n'], ""), signature(published.c), "{name}");
        assert_eq!(ffi::FUNCTIONS.contains(name), published.required, "{name}");
        assert!(
            published.source == Source::Both || !published.required,
            "{name} is not in every version"
        );
    }
    for (i, name) in ERRORS.iter().enumerate() {
        assert_eq!(errors::known(i as u32 + 1).name, *name, "the names, typed twice");
    }
    let place = |name: &str| STATUS.iter().position(|s| *s == name).expect("published");
    let places = [
        (ffi::status::POWER, "POWER"),
        (ffi::status::CONNECTED, "CONNECTED"),
        (ffi::status::RESET, "RESET"),
        (ffi::status::FORCE, "FORCE"),
        (ffi::status::ERROR, "ERROR"),
        (ffi::status::FORCE_OFF_CAUSE, "FORCE_OFF_CAUSE"),
    ];
    for (bound, name) in places {
        assert_eq!(bound, place(name), "{name}");
    }
    assert!(STATUS.len() <= ffi::STATUS_ROOM);
}

#[test]
fn every_function_is_called_by_a_device_that_opens_serves_and_closes() {
    let fake = Fake::new();
    fake.control.system_type.store(104, Relaxed);
    let mut device = fake.open();
    let push = stylet_hw::Wrench::from_force(nalgebra::Vector3::y());
    assert!(drive(&mut device, &push, |_| fake.control.calls_of("dhdGetComFreq") > 0));
    fake.control.fail("dhdGetStatus", 1, 1);
    assert!(drive(&mut device, &push, |_| fake.control.calls_of("dhdErrorGetLast") > 0));
    drop(device);
    for function in FUNCTIONS {
        assert!(
            fake.control.calls_of(function.name) > 0,
            "{} was not called",
            function.name
        );
    }
    assert_eq!(fake.control.wrong_ids.load(Relaxed), 0);
    assert_eq!(
        fake.control.not_expert.load(Relaxed),
        0,
        "the expert mode was on where it is needed"
    );
    assert_eq!(fake.control.overlapping.load(Relaxed), 0, "one thread makes the calls");
}

#[test]
fn a_library_without_required_functions_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let lacks = ["dhdSetForceAndTorqueAndGripperForce", "dhdGetStatus"];
    let other = library_without(&lacks, folder.path());
    let why = Api::load(Some(&other))
        .map(drop)
        .expect_err("two functions are missing");
    let [(_, LoadFailure::Incomplete(missing))] = &why.tried[..] else {
        panic!("{why}")
    };
    assert_eq!(*missing, ["dhdGetStatus", "dhdSetForceAndTorqueAndGripperForce"]);
    let findings = diagnose(folder.path(), &Err(why));
    assert!(findings[0].what.contains("it lacks dhdGetStatus"), "{findings:#?}");
    assert!(findings[0].severity == Severity::Problem && findings[0].cure.contains("--libdrd"));
}

#[test]
fn a_library_without_a_watchdog_serves_with_a_warning() {
    let _fake = Fake::new();
    let folder = tempfile::tempdir().expect("a folder");
    let lacks: Vec<_> = FUNCTIONS.iter().filter(|f| !f.required).map(|f| f.name).collect();
    let other = library_without(&lacks, folder.path());
    let control: &fake_drd::Control = fake_control::block_of(&other);
    let (ear, heard) = std::sync::mpsc::channel();
    let config = stylet_hw::ForceDimensionConfig {
        library: Some(other),
        ..config()
    };
    let report = Box::new(move |text: &str| drop(ear.send(text.to_owned())));
    let mut device = ForceDimension::open(config, Box::new(|| Ok("not armed".to_owned())), report).expect("serves");
    let said = heard.recv().expect("a message");
    assert!(said.contains("no watchdog"), "{said}");
    assert_eq!(device.description().watchdog_s, None);
    let push = stylet_hw::Wrench::from_force(nalgebra::Vector3::y());
    assert!(drive(&mut device, &push, |_| control.commanded_n() != [0.0; 3]));
}

#[test]
fn a_long_status_does_not_overrun_its_array() {
    let fake = Fake::new();
    for count in [16, 17, 20, ffi::STATUS_ROOM as u32] {
        fake.control.status_count.store(count, Relaxed);
        let mut device = fake.open();
        assert!(drive(&mut device, &stylet_hw::Wrench::zero(), Result::is_ok), "{count}");
    }
}

#[test]
fn the_device_recovers_from_every_error_of_the_interface() {
    let fake = Fake::new();
    let mut device = fake.open();
    let push = stylet_hw::Wrench::from_force(nalgebra::Vector3::y());
    for (i, name) in ERRORS.iter().enumerate() {
        let known = errors::known(i as u32 + 1);
        let felt = || fake.control.commanded_n() != [0.0; 3];
        assert!(drive(&mut device, &push, |s| s.is_ok() && felt()), "{name}: no force");
        let opens = fake.control.opens.load(Relaxed);
        fake.control.fail("dhdGetPositionAndOrientationFrame", known.code, 1);
        assert!(
            drive(&mut device, &push, |s| *s == Err(known.fault)),
            "{name} was not reported"
        );
        assert!(drive(&mut device, &push, |_| !felt()), "{name} left a force");
        assert!(
            drive(&mut device, &push, Result::is_ok),
            "{name}: the device did not come back"
        );
        let anew = fake.control.opens.load(Relaxed) > opens;
        assert_eq!(anew, known.response == Response::Reconnect, "{name}");
    }
    assert_eq!(device.error_count(), ERRORS.len() as u64);
}

#[test]
fn missing_parts_are_reported_with_a_remedy() {
    let fake = Fake::new();
    let open = || match fake_open() {
        Err(OpenError::Connection(why)) => why.to_string(),
        other => panic!("{:?}", other.map(drop)),
    };
    fake.control.unplugged.store(1, Relaxed);
    let why = open();
    assert!(why.contains("device 0 of 0") && why.contains("switch it on"), "{why}");
    fake.control.unplugged.store(0, Relaxed);
    fake.control.in_use.store(1, Relaxed);
    let why = open();
    assert!(
        why.contains("DHD_ERROR_DEVICE_IN_USE (20)") && why.contains("another program"),
        "{why}"
    );
    fake.control.in_use.store(0, Relaxed);
    fake.control.system_type.store(81, Relaxed);
    let why = open();
    assert!(
        why.contains("type 81") && why.contains("Force Dimension omega.7"),
        "{why}"
    );
    let unopened = stylet_hw::drd::of_device(&api(), 3);
    assert!(unopened[0].what.contains("device 3 of 1"), "{unopened:#?}");
    fake.control.system_type.store(0, Relaxed);
    let findings = stylet_hw::drd::of_device(&api(), 0);
    assert!(findings.iter().all(|f| f.severity == Severity::Good), "{findings:#?}");
    assert_eq!(fake.control.calls_of("dhdEnableForce"), 0, "tried without a force");
    assert_eq!(
        fake.control.calls_of("dhdSetForceAndTorqueAndGripperForce"),
        1,
        "zero, when the device of an unknown type was closed"
    );
    fake.control.status(ffi::status::RESET, 1);
    let findings = stylet_hw::drd::of_device(&api(), 0);
    assert!(
        findings.iter().any(|f| f.what.contains("not calibrated")),
        "{findings:#?}"
    );
    assert!(library().exists());
}

fn fake_open() -> Result<ForceDimension, OpenError> {
    ForceDimension::open(config(), Box::new(|| Ok(String::new())), Box::new(|_| ()))
}

#[test]
fn an_unknown_error_is_a_driver_s_error() {
    assert_eq!(errors::known(4711).fault, DeviceFault::Driver);
}
