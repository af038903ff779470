//! The exported functions.
//!
//! Pointers must be null where the interface allows it, or point to as many values as it states. A panic aborts the
//! process: it cannot unwind out of a C function.
#![allow(non_snake_case)]

use core::ffi::{CStr, c_char, c_int, c_ulong, c_ushort, c_void};
// SYNC: relaxed throughout; see `Control`.
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use crate::control::{CALLS_KEPT, Control, index_of};
use crate::driver::{Driver, HANDLE, control, driver, style};
use crate::scheduler;
use crate::table::{Kind, PARAMETERS};

type ServoFunction = unsafe extern "C" fn(*mut c_void) -> u32;

#[repr(C)]
pub struct ErrorInfo {
    code: u32,
    internal: c_int,
    device: u32,
}

/// Returns the block of this library.
#[unsafe(no_mangle)]
extern "C" fn fake_hd_control() -> *const Control {
    control()
}

/// Counts the call; true if the test makes it fail.
fn fails(function: &str) -> bool {
    let (c, index) = (control(), index_of(function));
    c.calls[index].fetch_add(1, Relaxed);
    if !scheduler::is_this_thread() {
        let number = c.call_count.fetch_add(1, Relaxed) as usize;
        c.call_order[number % CALLS_KEPT].store(index as u32, Relaxed);
    }
    let left = c.fail_times[index].load(Relaxed);
    if left > 0 {
        c.fail_times[index].store(left - 1, Relaxed);
        driver().raise(c.fail[index].load(Relaxed));
    }
    left > 0
}

#[unsafe(no_mangle)]
unsafe extern "C" fn hdInitDevice(name: *const c_char) -> u32 {
    const NONE: u32 = 0xFFFF_FFFF;
    if fails("hdInitDevice") {
        return NONE;
    }
    // SAFETY: null or a string that ends with zero, as the interface states.
    let name = (!name.is_null()).then(|| unsafe { CStr::from_ptr(name) });
    let known = match control().only_name.load(Relaxed) {
        1 => name == Some(c"Default PHANToM"),
        2 => name == Some(c"Default Device"),
        3 => name.is_none(),
        _ => true,
    };
    let mut d = driver();
    if control().unplugged.load(Relaxed) != 0 || !known {
        d.raise(0x0300);
        NONE
    } else if d.open {
        d.raise(0x0301);
        NONE
    } else {
        (d.open, d.broken, d.in_frame) = (true, false, false);
        control().inits.fetch_add(1, Relaxed);
        HANDLE
    }
}

/// True if `handle` is the open device; raises an error otherwise.
fn checked(d: &mut Driver, handle: u32) -> bool {
    let right = d.open && handle == HANDLE;
    if !right {
        d.raise(0x0104);
    }
    right
}

#[unsafe(no_mangle)]
extern "C" fn hdDisableDevice(handle: u32) {
    let failed = fails("hdDisableDevice");
    let mut d = driver();
    if !failed && checked(&mut d, handle) {
        d.open = false;
        d.enabled.clear();
        d.force_n = [0.0; 3];
    }
}

#[unsafe(no_mangle)]
extern "C" fn hdMakeCurrentDevice(handle: u32) {
    if !fails("hdMakeCurrentDevice") {
        checked(&mut driver(), handle);
    }
}

#[unsafe(no_mangle)]
extern "C" fn hdBeginFrame(handle: u32) {
    let failed = fails("hdBeginFrame");
    let mut d = driver();
    if failed || !checked(&mut d, handle) {
        return;
    }
    if d.in_frame {
        d.raise(0x0400);
    }
    d.in_frame = true;
    if d.is_absent() {
        d.broken = true;
        d.raise(0x0302);
    }
}

#[unsafe(no_mangle)]
extern "C" fn hdEndFrame(handle: u32) {
    let failed = fails("hdEndFrame");
    let mut d = driver();
    if !d.in_frame {
        d.raise(0x0401);
    }
    d.in_frame = false;
    if failed || !checked(&mut d, handle) {
        return;
    }
    d.check_force();
    if control().warm_motors.load(Relaxed) != 0 {
        d.raise(0x0200);
    }
    match control().error_in_frame.swap(0, Relaxed) {
        0 => {}
        code => d.raise(code),
    }
}

#[unsafe(no_mangle)]
extern "C" fn hdGetError() -> ErrorInfo {
    fails("hdGetError");
    let code = driver().errors.pop().unwrap_or(0);
    ErrorInfo {
        code,
        internal: -(code as c_int),
        device: HANDLE,
    }
}

const CAPABILITIES: [u32; 7] = [0x4000, 0x4001, 0x4002, 0x4003, 0x4004, 0x2606, 0x2607];

#[unsafe(no_mangle)]
extern "C" fn hdEnable(capability: u32) {
    if fails("hdEnable") {
        return;
    }
    let mut d = driver();
    if !CAPABILITIES.contains(&capability) {
        d.raise(0x0100);
    } else if !d.enabled.contains(&capability) {
        d.enabled.push(capability);
    }
}

#[unsafe(no_mangle)]
extern "C" fn hdDisable(capability: u32) {
    if fails("hdDisable") {
        return;
    }
    let mut d = driver();
    if CAPABILITIES.contains(&capability) {
        d.enabled.retain(|c| *c != capability);
    } else {
        d.raise(0x0100);
    }
}

#[unsafe(no_mangle)]
extern "C" fn hdIsEnabled(capability: u32) -> u8 {
    let off = fails("hdIsEnabled") || control().no_force.load(Relaxed) != 0;
    u8::from(!off && driver().enabled.contains(&capability))
}

/// Returns the number of values of a parameter of one of `kinds`; raises an error and returns `None` otherwise.
fn count_of(d: &mut Driver, parameter: u32, kinds: &[Kind], null: bool) -> Option<usize> {
    let found = PARAMETERS.iter().find(|(number, ..)| *number == parameter);
    match found {
        None => d.raise(0x0100),
        Some((_, kind, _)) if !kinds.contains(kind) => d.raise(0x0103),
        Some(_) if null => d.raise(0x0101),
        Some((_, _, count)) => return Some(*count),
    }
    None
}

/// # Safety
///
/// `to` has room for all `values`.
unsafe fn give<T: Copy>(to: *mut T, values: &[T]) {
    // SAFETY: by the contract of this function.
    unsafe { core::ptr::copy_nonoverlapping(values.as_ptr(), to, values.len()) };
}

#[unsafe(no_mangle)]
unsafe extern "C" fn hdGetIntegerv(parameter: u32, values: *mut c_int) {
    let failed = fails("hdGetIntegerv");
    let mut d = driver();
    if !failed && count_of(&mut d, parameter, &[Kind::Ints], values.is_null()).is_some() {
        // SAFETY: the caller provides room for as many as the interface states.
        unsafe { give(values, &d.ints(parameter).unwrap_or_default()) };
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn hdGetDoublev(parameter: u32, values: *mut f64) {
    let failed = fails("hdGetDoublev");
    let mut d = driver();
    if !failed && count_of(&mut d, parameter, &[Kind::Reals], values.is_null()).is_some() {
        // SAFETY: the caller provides room for as many as the interface states.
        unsafe { give(values, &d.reals(parameter).unwrap_or_default()) };
    }
}

#[unsafe(no_mangle)]
extern "C" fn hdGetString(parameter: u32) -> *const c_char {
    let failed = fails("hdGetString");
    if failed || count_of(&mut driver(), parameter, &[Kind::Text], false).is_none() {
        return core::ptr::null();
    }
    let text = match (parameter, control().model.load(Relaxed)) {
        (0x2500, _) => c"3.00.66",
        (0x2501, 0) => c"PHANTOM Premium 1.5 6DOF",
        (0x2501, 1) => c"PHANTOM Premium 1.5",
        (0x2501, 2) => c"PHANTOM Omni",
        (0x2501, _) => c"Novint Falcon",
        (0x2502, _) => c"4.3.3",
        (0x2503, _) => c"Fake",
        _ => c"41221500010",
    };
    text.as_ptr()
}

fn set_reals(parameter: u32, values: [f64; 3]) {
    let mut d = driver();
    if !d.in_frame {
        d.raise(0x0402);
        return;
    }
    match parameter {
        0x2700 => d.force_n = values,
        0x2704 if control().model.load(Relaxed) == 0 => d.torque_mnm = values,
        _ => d.raise(0x0100),
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn hdSetDoublev(parameter: u32, values: *const f64) {
    if !fails("hdSetDoublev") {
        // SAFETY: three numbers, as the interface states.
        set_reals(parameter, [0, 1, 2].map(|i| unsafe { *values.add(i) }));
    }
}

#[unsafe(no_mangle)]
extern "C" fn hdCheckCalibration() -> u32 {
    if fails("hdCheckCalibration") || control().uncalibrated.load(Relaxed) == 0 {
        return 0x5000;
    }
    let in_inkwell = control().in_inkwell.load(Relaxed) != 0;
    let ready = style() == 2 || (style() & 4 != 0 && in_inkwell);
    if ready { 0x5001 } else { 0x5002 }
}

#[unsafe(no_mangle)]
extern "C" fn hdCheckCalibrationStyle() -> u32 {
    fails("hdCheckCalibrationStyle");
    style()
}

#[unsafe(no_mangle)]
extern "C" fn hdUpdateCalibration(requested: u32) {
    if fails("hdUpdateCalibration") {
        return;
    }
    let c = control();
    if requested & style() == 0 {
        driver().raise(0x0101);
        return;
    }
    if requested == 4 && c.in_inkwell.load(Relaxed) == 0 {
        driver().raise(0x0102);
        return;
    }
    if requested == 1 {
        c.miscalibrated
            .store(u32::from(c.in_neutral_pose.load(Relaxed) == 0), Relaxed);
    }
    c.uncalibrated.store(0, Relaxed);
}

#[unsafe(no_mangle)]
extern "C" fn hdStartScheduler() {
    if !fails("hdStartScheduler") {
        scheduler::start();
    }
}

#[unsafe(no_mangle)]
extern "C" fn hdStopScheduler() {
    if !fails("hdStopScheduler") {
        scheduler::stop();
    }
}

#[unsafe(no_mangle)]
extern "C" fn hdSetSchedulerRate(rate_hz: c_ulong) {
    if fails("hdSetSchedulerRate") {
        return;
    }
    let mut d = driver();
    if [500, 1000, 2000].contains(&rate_hz) {
        d.rate_hz = rate_hz;
    } else {
        d.raise(0x0101);
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn hdScheduleAsynchronous(
    function: ServoFunction,
    context: *mut c_void,
    _priority: c_ushort,
) -> c_ulong {
    if fails("hdScheduleAsynchronous") {
        return 0;
    }
    driver().schedule(function, context as usize)
}

#[unsafe(no_mangle)]
extern "C" fn hdUnschedule(id: c_ulong) {
    if fails("hdUnschedule") {
        return;
    }
    let mut d = driver();
    let before = d.callbacks.len();
    d.callbacks.retain(|c| c.id != id);
    if d.callbacks.len() == before {
        d.raise(0x0101);
    }
}

fn is_scheduled(id: c_ulong) -> bool {
    driver().callbacks.iter().any(|c| c.id == id)
}

fn wait_for(id: c_ulong) {
    let start = Instant::now();
    while is_scheduled(id) && start.elapsed() < Duration::from_secs(1) {
        std::thread::sleep(Duration::from_micros(200));
    }
}

#[unsafe(no_mangle)]
extern "C" fn hdWaitForCompletion(id: c_ulong, code: u32) -> u8 {
    if fails("hdWaitForCompletion") {
        return 0;
    }
    if code == 1 {
        wait_for(id);
    }
    u8::from(is_scheduled(id))
}
