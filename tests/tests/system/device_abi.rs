//! Every function and every error of the driver's interface, called through the fake library.

use core::ffi::c_void;
use core::ptr::{null, null_mut};
use fake_hd::table::{ERRORS, FUNCTIONS};
use nalgebra::Vector3;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use stylet_hw::libhd::errors::{self, Response};
use stylet_hw::libhd::{Api, ffi};
use stylet_hw::{Device, Wrench};
use stylet_tests::phantom::{Fake, drive, library};

unsafe extern "system" fn always(_: *mut c_void) -> u32 {
    ffi::CALLBACK_CONTINUE
}

/// Calls each function as documented; returns the error that each left, which must be none.
fn call_all(api: &Api) -> Vec<(&'static str, u32)> {
    let mut left = Vec::new();
    // SAFETY: no preconditions.
    let error = || unsafe { (api.hdGetError)() }.code;
    macro_rules! call {
        ($name:ident($($argument:expr),*)) => {{
            // SAFETY: arguments are those that the interface states, buffers at least as long.
            let result = unsafe { (api.$name)($($argument),*) };
            left.push((stringify!($name), error()));
            result
        }};
    }
    let handle = call!(hdInitDevice(c"Default PHANToM".as_ptr()));
    call!(hdMakeCurrentDevice(handle));
    let text = call!(hdGetString(ffi::parameter::MODEL));
    // SAFETY: the driver's strings are static and end with zero.
    assert_eq!(unsafe { core::ffi::CStr::from_ptr(text) }, c"PHANTOM Premium 1.5 6DOF");
    assert_eq!(call!(hdCheckCalibration()), ffi::calibration::OK);
    assert_eq!(call!(hdCheckCalibrationStyle()), ffi::style::ENCODER_RESET);
    call!(hdUpdateCalibration(ffi::style::ENCODER_RESET));
    call!(hdEnable(ffi::capability::FORCE_OUTPUT));
    assert_eq!(call!(hdIsEnabled(ffi::capability::FORCE_OUTPUT)), 1);
    call!(hdDisable(ffi::capability::FORCE_OUTPUT));
    let (mut int, mut doubles) = (-1, [0.0_f64; 16]);
    call!(hdGetIntegerv(ffi::parameter::OUTPUT_DOF, &mut int));
    call!(hdGetDoublev(ffi::parameter::TRANSFORM, doubles.as_mut_ptr()));
    assert_eq!((int, doubles[15]), (6, 1.0));
    call!(hdBeginFrame(handle));
    call!(hdSetDoublev(ffi::parameter::FORCE, [0.0; 3].as_ptr()));
    call!(hdEndFrame(handle));
    call!(hdSetSchedulerRate(1000));
    call!(hdStartScheduler());
    let schedule = call!(hdScheduleAsynchronous(always, null_mut(), ffi::PRIORITY_MAX));
    assert_eq!(call!(hdWaitForCompletion(schedule, ffi::WAIT_CHECK_STATUS)), 1);
    call!(hdStopScheduler());
    call!(hdUnschedule(schedule));
    call!(hdDisableDevice(handle));
    left
}

#[test]
fn every_function_is_bound_and_does_what_the_interface_says() {
    let fake = Fake::new();
    assert_eq!(ffi::FUNCTIONS, FUNCTIONS, "the names, typed twice");
    let api = Api::load(Some(&library())).unwrap();
    for (function, error) in call_all(&api) {
        assert_eq!(error, 0, "{function}");
    }
    for function in FUNCTIONS {
        let calls = fake.control.calls_of(function);
        println!("{function:28} {calls} calls");
        assert!(calls > 0, "{function} was not called");
    }
}

#[test]
fn wrong_calls_get_the_errors_of_the_interface() {
    let _fake = Fake::new();
    let api = Api::load(Some(&library())).unwrap();
    // SAFETY: no preconditions.
    let error = || unsafe { (api.hdGetError)() }.code;
    let mut one = 0.0;
    // SAFETY: buffers are as long as the interface states or are not written; null is refused.
    unsafe {
        (api.hdGetDoublev)(0x9999, &mut one);
        assert_eq!(error(), 0x0100);
        (api.hdGetDoublev)(ffi::parameter::BUTTONS, &mut one);
        assert_eq!(error(), 0x0103);
        (api.hdGetDoublev)(ffi::parameter::MAX_FORCE, null_mut());
        assert_eq!(error(), 0x0101);
        (api.hdBeginFrame)(99);
        assert_eq!(error(), 0x0104);
        (api.hdEndFrame)(99);
        assert_eq!((error(), error()), (0x0104, 0x0401), "the newest comes first");
        (api.hdSetDoublev)(ffi::parameter::FORCE, [0.0; 3].as_ptr());
        assert_eq!(error(), 0x0402);
        (api.hdSetSchedulerRate)(1234);
        assert_eq!(error(), 0x0101);
        let handle = (api.hdInitDevice)(null());
        assert_eq!((api.hdInitDevice)(null()), ffi::INVALID_HANDLE);
        assert_eq!(error(), 0x0301);
        (api.hdDisableDevice)(handle);
    }
}

#[test]
fn every_interface_error_turns_the_force_off_and_the_device_recovers() {
    let fake = Fake::new();
    let mut device = fake.open();
    let push = Wrench::from_force(Vector3::new(0.0, 1.0, 0.0));
    let long = Duration::from_secs(10);
    for (code, name) in ERRORS.into_iter().filter(|(code, _)| *code != 0) {
        let known = errors::known(code);
        assert_eq!(known.name, name, "the names, typed twice");
        assert!(
            drive(&mut device, &push, long, |s| s.is_ok() && fake.control.force()[1] > 0.9),
            "{name}: no force"
        );
        let inits = fake.control.inits.load(Relaxed);
        fake.control.error_in_frame.store(code, Relaxed);
        assert!(
            drive(&mut device, &push, long, |s| *s == Err(known.fault)),
            "{name} was not reported"
        );
        assert!(
            drive(&mut device, &push, long, |_| fake.control.force() == [0.0; 3]),
            "{name} left a force"
        );
        assert!(
            drive(&mut device, &push, long, Result::is_ok),
            "{name}: the device did not come back"
        );
        let anew = fake.control.inits.load(Relaxed) - inits;
        assert_eq!(
            anew > 0,
            known.response == Response::Reconnect,
            "{name}: initialised anew {anew} times"
        );
        println!("0x{code:04x} {name:30} -> {:?}, {:?}", known.fault, known.response);
    }
    assert_eq!(ERRORS.len(), errors::KNOWN.len() + 1, "all but success");
    assert!(device.error_count() >= 21);
    assert_eq!(device.write(&Wrench::zero()), Ok(()));
}
