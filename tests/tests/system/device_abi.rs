//! Every function and every error of the driver's interface, called through the fake library.

use core::ffi::{c_long, c_void};
use core::ptr::{null, null_mut};
use fake_hd::table::{ERRORS, FUNCTIONS};
use nalgebra::Vector3;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use stylet_hw::libhd::errors::{self, Response};
use stylet_hw::libhd::{Api, ffi};
use stylet_hw::{Device, Wrench};
use stylet_tests::phantom::{Fake, drive, library};

unsafe extern "system" fn once(context: *mut c_void) -> u32 {
    // SAFETY: the tests give a counter that outlives the call.
    unsafe { &*context.cast::<std::sync::atomic::AtomicU32>() }.fetch_add(1, Relaxed);
    ffi::CALLBACK_DONE
}

unsafe extern "system" fn always(_: *mut c_void) -> u32 {
    ffi::CALLBACK_CONTINUE
}

/// Calls each function as documented; returns the error that each left, which must be none.
fn call_all(api: &Api) -> Vec<(&'static str, u32)> {
    let mut left = Vec::new();
    // SAFETY: no preconditions.
    let error = || unsafe { (api.hdGetError)() }.code;
    let ran = std::sync::atomic::AtomicU32::new(0);
    let context: *mut c_void = core::ptr::from_ref(&ran).cast_mut().cast();
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
    assert_eq!(call!(hdGetCurrentDevice()), handle);
    assert_eq!(
        call!(hdDeploymentLicense(c"a".as_ptr(), c"b".as_ptr(), c"c".as_ptr())),
        1
    );
    let text = call!(hdGetString(ffi::parameter::MODEL));
    // SAFETY: the driver's strings are static and end with zero.
    assert_eq!(unsafe { core::ffi::CStr::from_ptr(text) }, c"PHANTOM Premium 1.5 6DOF");
    let text = call!(hdGetErrorString(0x0302));
    // SAFETY: as above.
    assert_eq!(unsafe { core::ffi::CStr::from_ptr(text) }, c"Communication error");
    assert_eq!(call!(hdCheckCalibration()), ffi::calibration::OK);
    assert_eq!(call!(hdCheckCalibrationStyle()), ffi::style::ENCODER_RESET);
    call!(hdUpdateCalibrationMessage(ffi::style::ENCODER_RESET));
    call!(hdUpdateCalibration(ffi::style::ENCODER_RESET));
    call!(hdEnable(ffi::capability::FORCE_OUTPUT));
    assert_eq!(call!(hdIsEnabled(ffi::capability::FORCE_OUTPUT)), 1);
    call!(hdDisable(ffi::capability::FORCE_OUTPUT));
    let (mut flag, mut int, mut float, mut doubles, mut longs) = (9_u8, -1, 0.0_f32, [0.0_f64; 16], [0 as c_long; 6]);
    call!(hdGetBooleanv(0x2001, &mut flag));
    call!(hdGetIntegerv(ffi::parameter::OUTPUT_DOF, &mut int));
    call!(hdGetFloatv(0x2552, &mut float));
    call!(hdGetDoublev(ffi::parameter::TRANSFORM, doubles.as_mut_ptr()));
    call!(hdGetLongv(ffi::parameter::ENCODERS, longs.as_mut_ptr()));
    assert_eq!((flag, int, float, doubles[15], longs[5]), (0, 6, -100.0, 1.0, 6000));
    call!(hdScaleGimbalAngles(2.0, 3.0, 4.0, doubles.as_mut_ptr()));
    assert_eq!((doubles[0], doubles[5], doubles[10]), (2.0, 3.0, 4.0));
    call!(hdSetIntegerv(0x2900, &1));
    call!(hdBeginFrame(handle));
    call!(hdSetFloatv(ffi::parameter::FORCE, [0.5_f32, 0.0, 0.0].as_ptr()));
    call!(hdSetDoublev(ffi::parameter::FORCE, [0.0; 3].as_ptr()));
    call!(hdEndFrame(handle));
    call!(hdSetSchedulerRate(1000));
    call!(hdStartScheduler());
    call!(hdScheduleSynchronous(once, context, ffi::PRIORITY_MAX));
    assert_eq!(ran.load(Relaxed), 1, "it waits until the callback has run");
    let schedule = call!(hdScheduleAsynchronous(always, null_mut(), ffi::PRIORITY_MAX));
    assert_eq!(call!(hdWaitForCompletion(schedule, ffi::WAIT_CHECK_STATUS)), 1);
    assert!(call!(hdGetSchedulerTimeStamp()) >= 0.0);
    call!(hdStopScheduler());
    call!(hdUnschedule(schedule));
    // The interface names no value for either: they are called to be refused.
    // SAFETY: one value each.
    unsafe {
        (api.hdSetBooleanv)(0x2001, &0);
        assert_eq!(error(), 0x0100);
        (api.hdSetLongv)(0x2750, [0 as c_long; 6].as_ptr());
        assert_eq!(error(), 0x0204);
    }
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
        assert_eq!((api.hdDeploymentLicense)(null(), null(), null()), 0);
        assert_eq!(error(), 0x0600);
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
    assert!(device.readings().errors >= 21);
    assert_eq!(device.write(&Wrench::zero()), Ok(()));
}
