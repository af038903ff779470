//! The exported functions.
//!
//! Pointers must point to as many values as the interface states. A panic aborts the process: it cannot unwind out of a
//! C function.
#![allow(non_snake_case)]

use core::ffi::{c_char, c_double, c_int, c_uchar, c_uint, c_ushort};
use std::cell::Cell;
// SYNC: relaxed throughout; see `Block`.
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use crate::control::{CALLS_KEPT, Control, put};
use crate::firmware::{Firmware, ID, control, firmware, now_us};
use crate::table::index_of;

const INVALID_INDEX: u32 = 15;

thread_local! {
    static LAST_ERROR: Cell<u32> = const { Cell::new(0) };
}

/// Returns the block of this library.
#[unsafe(no_mangle)]
extern "C" fn fake_drd_control() -> *const Control {
    control()
}

fn failed(code: u32) -> c_int {
    LAST_ERROR.set(code);
    -1
}

/// Counts a call while it is under way.
struct Call(bool);

static UNDER_WAY: AtomicU32 = AtomicU32::new(0);

impl Drop for Call {
    fn drop(&mut self) {
        UNDER_WAY.fetch_sub(1, Relaxed);
    }
}

/// Counts the call, and takes its time; returns whether the test makes it fail.
fn call(function: &str) -> Call {
    let (c, index) = (control(), index_of(function));
    c.calls[index].fetch_add(1, Relaxed);
    let number = c.call_count.fetch_add(1, Relaxed) as usize;
    if number < CALLS_KEPT {
        c.call_order[number].store(index as u32, Relaxed);
    }
    if UNDER_WAY.fetch_add(1, Relaxed) > 0 {
        c.overlapping.fetch_add(1, Relaxed);
    }
    match c.late_us.load(Relaxed) {
        0 => {}
        late => std::thread::sleep(Duration::from_micros(late.into())),
    }
    let left = c.fail_times[index].load(Relaxed);
    if left > 0 {
        c.fail_times[index].store(left - 1, Relaxed);
        LAST_ERROR.set(c.fail[index].load(Relaxed));
    }
    Call(left > 0)
}

/// Executes a call to the open device; -1 if the test makes it fail, or the device is missing.
fn to_device(function: &str, id: c_char, work: impl FnOnce(&mut Firmware) -> c_int) -> c_int {
    let call = call(function);
    let mut device = firmware();
    device.advance();
    if call.0 {
        -1
    } else if !device.open || id != ID {
        control().wrong_ids.fetch_add(1, Relaxed);
        failed(INVALID_INDEX)
    } else if device.broken {
        failed(2)
    } else {
        work(&mut device)
    }
}

/// As `to_device`, for functions that need the expert mode.
fn expert(function: &str, id: c_char, work: impl FnOnce(&mut Firmware) -> c_int) -> c_int {
    to_device(function, id, |device| {
        if device.expert {
            return work(device);
        }
        control().not_expert.fetch_add(1, Relaxed);
        failed(9)
    })
}

#[unsafe(no_mangle)]
extern "C" fn dhdErrorGetLast() -> c_int {
    let _call = call("dhdErrorGetLast");
    LAST_ERROR.get() as c_int
}

#[unsafe(no_mangle)]
extern "C" fn dhdGetDeviceCount() -> c_int {
    match call("dhdGetDeviceCount").0 {
        true => -1,
        false => c_int::from(control().unplugged.load(Relaxed) == 0),
    }
}

#[unsafe(no_mangle)]
extern "C" fn dhdOpenID(id: c_char) -> c_int {
    let call = call("dhdOpenID");
    let (c, mut device) = (control(), firmware());
    if call.0 {
        -1
    } else if c.unplugged.load(Relaxed) != 0 || id != ID {
        failed(5)
    } else if c.in_use.load(Relaxed) != 0 || device.open {
        failed(20)
    } else {
        *device = Firmware {
            open: true,
            ..Firmware::default()
        };
        c.force_mode.store(0, Relaxed);
        c.opens.fetch_add(1, Relaxed);
        c_int::from(ID)
    }
}

#[unsafe(no_mangle)]
extern "C" fn dhdClose(id: c_char) -> c_int {
    let call = call("dhdClose");
    let mut device = firmware();
    if !device.open || id != ID {
        control().wrong_ids.fetch_add(1, Relaxed);
        return failed(INVALID_INDEX);
    }
    device.open = false;
    // A device whose cable is unplugged does not receive it.
    if !device.broken {
        control().force_mode.store(0, Relaxed);
    }
    if call.0 { -1 } else { 0 }
}

#[unsafe(no_mangle)]
extern "C" fn dhdStop(id: c_char) -> c_int {
    to_device("dhdStop", id, |device| {
        let [x, y, z] = control().commanded_n();
        put(&control().force_at_stop_n, (x * x + y * y + z * z).sqrt());
        device.turn_off(4);
        0
    })
}

#[unsafe(no_mangle)]
extern "C" fn dhdEnableForce(on: c_uchar, id: c_char) -> c_int {
    to_device("dhdEnableForce", id, |device| {
        let on = u32::from(on != 0 && control().stays_off.load(Relaxed) == 0);
        control().force_mode.store(on, Relaxed);
        control().commanded_us.store(now_us(), Relaxed);
        if on == 0 {
            device.off_cause = 4;
        }
        0
    })
}

#[unsafe(no_mangle)]
extern "C" fn dhdGetSystemType(id: c_char) -> c_int {
    to_device("dhdGetSystemType", id, |_| match control().system_type.load(Relaxed) {
        0 => 35,
        kind => kind,
    })
}

#[unsafe(no_mangle)]
extern "C" fn dhdGetSystemName(_id: c_char) -> *const c_char {
    match call("dhdGetSystemName").0 {
        true => core::ptr::null(),
        false => c"fake device".as_ptr(),
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn dhdGetSerialNumber(serial: *mut c_ushort, id: c_char) -> c_int {
    to_device("dhdGetSerialNumber", id, |_| {
        // SAFETY: one number, as the interface states.
        unsafe { *serial = 1234 };
        0
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn dhdGetSDKVersion(major: *mut c_int, minor: *mut c_int, release: *mut c_int, revision: *mut c_int) {
    let _call = call("dhdGetSDKVersion");
    // SAFETY: one number each, as the interface states.
    unsafe { (*major, *minor, *release, *revision) = (3, 17, 5, 7) };
}

#[unsafe(no_mangle)]
extern "C" fn dhdHasActiveWrist(id: c_char) -> bool {
    let kind = to_device("dhdHasActiveWrist", id, |_| control().system_type.load(Relaxed));
    matches!(kind, 64 | 104 | 105)
}

#[unsafe(no_mangle)]
unsafe extern "C" fn dhdGetStatus(status: *mut c_int, id: c_char) -> c_int {
    to_device("dhdGetStatus", id, |device| {
        let numbers = device.status();
        // SAFETY: the caller has room for as many as any version writes.
        unsafe { core::ptr::copy_nonoverlapping(numbers.as_ptr(), status, numbers.len()) };
        0
    })
}

#[unsafe(no_mangle)]
extern "C" fn dhdGetButtonMask(id: c_char) -> c_uint {
    let mut buttons = 0;
    to_device("dhdGetButtonMask", id, |_| {
        buttons = control().buttons.load(Relaxed);
        0
    });
    buttons
}

#[unsafe(no_mangle)]
extern "C" fn dhdGetComFreq(id: c_char) -> c_double {
    let answer = to_device("dhdGetComFreq", id, |_| 0);
    let frozen = control().frozen.load(Relaxed) != 0;
    if answer < 0 || frozen { 0.0 } else { 1.0 }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn dhdGetPositionAndOrientationFrame(
    x: *mut c_double,
    y: *mut c_double,
    z: *mut c_double,
    rows: *mut [c_double; 3],
    id: c_char,
) -> c_int {
    to_device("dhdGetPositionAndOrientationFrame", id, |device| {
        let guarded = control().time_guard.load(Relaxed) != 0;
        let (tip, matrix) = if guarded { device.pose } else { device.read_pose() };
        // SAFETY: one number each and three rows, as the interface states.
        unsafe {
            [*x, *y, *z] = tip;
            core::ptr::copy_nonoverlapping(matrix.as_ptr(), rows, 3);
        }
        c_int::from(guarded)
    })
}

#[unsafe(no_mangle)]
extern "C" fn dhdSetForceAndTorqueAndGripperForce(
    fx: c_double,
    fy: c_double,
    fz: c_double,
    tx: c_double,
    ty: c_double,
    tz: c_double,
    _gripper: c_double,
    id: c_char,
) -> c_int {
    while control().hang.load(Relaxed) != 0 && control().now_us.load(Relaxed) == 0 {
        std::thread::sleep(Duration::from_micros(200));
    }
    to_device("dhdSetForceAndTorqueAndGripperForce", id, |device| {
        if control().frozen.load(Relaxed) == 0 {
            device.command([fx, fy, fz, tx, ty, tz]);
        }
        0
    })
}

#[unsafe(no_mangle)]
extern "C" fn dhdEnableExpertMode() -> c_int {
    let call = call("dhdEnableExpertMode");
    firmware().expert = !call.0;
    if call.0 { -1 } else { 0 }
}

#[unsafe(no_mangle)]
extern "C" fn dhdDisableExpertMode() -> c_int {
    let _call = call("dhdDisableExpertMode");
    firmware().expert = false;
    0
}

#[unsafe(no_mangle)]
extern "C" fn dhdSetTimeGuard(_us: c_int, id: c_char) -> c_int {
    expert("dhdSetTimeGuard", id, |_| 0)
}

#[unsafe(no_mangle)]
extern "C" fn dhdSetWatchdog(units: c_uchar, id: c_char) -> c_int {
    expert("dhdSetWatchdog", id, |_| {
        if control().no_watchdog.load(Relaxed) != 0 {
            return failed(6);
        }
        control().watchdog_units.store(units.into(), Relaxed);
        0
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn dhdGetWatchdog(units: *mut c_uchar, id: c_char) -> c_int {
    expert("dhdGetWatchdog", id, |_| {
        // SAFETY: one number, as the interface states.
        unsafe { *units = control().watchdog_units.load(Relaxed) as c_uchar };
        0
    })
}

#[unsafe(no_mangle)]
extern "C" fn dhdSetMaxForce(_limit_n: c_double, id: c_char) -> c_int {
    to_device("dhdSetMaxForce", id, |_| 0)
}

#[unsafe(no_mangle)]
extern "C" fn dhdSetMaxTorque(_limit_nm: c_double, id: c_char) -> c_int {
    to_device("dhdSetMaxTorque", id, |_| 0)
}
