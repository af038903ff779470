//! The C interface of `libHD.so`, OpenHaptics 3.00 to 3.30, loaded at run time.
//!
//! Types, numbers and the 22 functions are facts of the vendor's interface (HDAPI reference; names
//! checked against the symbols of `libHD.so.3.0.0`).

#![allow(non_snake_case)]

use core::ffi::{c_char, c_int, c_ulong, c_ushort, c_void};

use crate::library::{Driver, functions};

/// Handle of a device; [`INVALID_HANDLE`] for none.
pub type Handle = u32;
/// Value of [`parameter`], [`capability`], [`calibration`] or [`style`].
pub type Enum = u32;
/// The scheduler's handle of a callback.
pub type Schedule = c_ulong;
/// A function that the scheduler runs each servo tick with its context; returns [`CALLBACK_DONE`] or
/// [`CALLBACK_CONTINUE`].
pub type Callback = unsafe extern "system" fn(*mut c_void) -> u32;

/// One entry of the driver's error stack; returned by value.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorInfo {
    /// Number of the error, 0 for none.
    pub code: u32,
    /// The driver's internal number.
    pub internal: c_int,
    /// The device that caused it.
    pub device: Handle,
}

/// No device.
pub const INVALID_HANDLE: Handle = 0xFFFF_FFFF;
/// The scheduler removes the callback.
pub const CALLBACK_DONE: u32 = 0;
/// The scheduler calls again in the next tick.
pub const CALLBACK_CONTINUE: u32 = 1;
/// `hdWaitForCompletion` returns at once.
pub const WAIT_CHECK_STATUS: u32 = 0;
/// Order among the callbacks of one tick, not a thread priority.
pub const PRIORITY_MAX: c_ushort = 0xFFFF;

/// Parameters that can be read and set: count and unit of each.
pub mod parameter {
    /// 1 int, a bit mask.
    pub const BUTTONS: u32 = 0x2000;
    /// 3, mm/s, smoothed by the driver.
    pub const VELOCITY: u32 = 0x2051;
    /// 16, column-major, mm.
    pub const TRANSFORM: u32 = 0x2052;
    /// 3, rad: right +, up -, clockwise +.
    pub const GIMBAL_ANGLES: u32 = 0x2150;
    /// String: version of OpenHaptics.
    pub const VERSION: u32 = 0x2500;
    /// String: model of the device.
    pub const MODEL: u32 = 0x2501;
    /// String: version of the device driver.
    pub const DRIVER_VERSION: u32 = 0x2502;
    /// String: serial number.
    pub const SERIAL: u32 = 0x2504;
    /// 1 int; 6 means torques.
    pub const OUTPUT_DOF: u32 = 0x2554;
    /// 1 int, bits of [`super::style`].
    pub const CALIBRATION_STYLE: u32 = 0x2555;
    /// 1, N.
    pub const MAX_FORCE: u32 = 0x2603;
    /// 1, N.
    pub const MAX_CONTINUOUS_FORCE: u32 = 0x2604;
    /// 3 or 6, 0 to 1, predicted by the driver.
    pub const MOTOR_TEMPERATURE: u32 = 0x2605;
    /// 3, N.
    pub const FORCE: u32 = 0x2700;
    /// 3, mN m, one for each gimbal joint.
    pub const GIMBAL_TORQUE: u32 = 0x2704;
}

/// Capabilities that can be enabled.
pub mod capability {
    /// Forces.
    pub const FORCE_OUTPUT: u32 = 0x4000;
    /// The driver clamps forces to the maximum of the device.
    pub const MAX_FORCE_CLAMPING: u32 = 0x4001;
    /// The driver raises the force gradually after the start.
    pub const FORCE_RAMPING: u32 = 0x4002;
    /// The driver turns forces off that exceed the limit of the software.
    pub const SOFTWARE_FORCE_LIMIT: u32 = 0x4003;
    /// Capabilities that a session enables, in this order.
    pub const AT_START: [u32; 4] = [FORCE_OUTPUT, MAX_FORCE_CLAMPING, FORCE_RAMPING, SOFTWARE_FORCE_LIMIT];
}

/// Answers of `hdCheckCalibration`.
pub mod calibration {
    /// The device is calibrated.
    pub const OK: u32 = 0x5000;
    /// `hdUpdateCalibration` completes the calibration.
    pub const NEEDS_UPDATE: u32 = 0x5001;
}

/// Calibration styles of a device, a bit each.
pub mod style {
    /// The present pose becomes the neutral one.
    pub const ENCODER_RESET: u32 = 1;
    /// The driver calibrates while the arm moves.
    pub const AUTO: u32 = 2;
    /// The stylus stands in the inkwell.
    pub const INKWELL: u32 = 4;
}

/// The library, and the names under which it is installed.
pub const DRIVER: Driver = Driver {
    name: "OpenHaptics (libHD.so)",
    files: &["libHD.so", "libHD.so.3.0", "libHD.so.3.4"],
};

functions! {
    required {
        fn hdInitDevice(*const c_char) -> Handle;
        fn hdDisableDevice(Handle);
        fn hdMakeCurrentDevice(Handle);
        fn hdBeginFrame(Handle);
        fn hdEndFrame(Handle);
        fn hdGetError() -> ErrorInfo;
        fn hdEnable(Enum);
        fn hdDisable(Enum);
        fn hdIsEnabled(Enum) -> u8;
        fn hdGetIntegerv(Enum, *mut c_int);
        fn hdGetDoublev(Enum, *mut f64);
        fn hdGetString(Enum) -> *const c_char;
        fn hdSetDoublev(Enum, *const f64);
        fn hdCheckCalibration() -> Enum;
        fn hdCheckCalibrationStyle() -> Enum;
        fn hdUpdateCalibration(Enum);
        fn hdStartScheduler();
        fn hdStopScheduler();
        fn hdSetSchedulerRate(c_ulong);
        fn hdScheduleAsynchronous(Callback, *mut c_void, c_ushort) -> Schedule;
        fn hdUnschedule(Schedule);
        fn hdWaitForCompletion(Schedule, u32) -> u8;
    }
    optional {}
}
