//! The C interface of `libdrd.so` and `libdhd.so`, Force Dimension SDK 3.7 to 3.17, loaded at run
//! time.
//!
//! Types and numbers are facts of the vendor's interface (`dhdc.h` of SDK 3.17.5, in github
//! chai3d/chai3d at 7c76b1f; of 3.7.0 in CHAI3D 3.2). Both libraries have all `dhd` functions;
//! `libdrd.so` adds regulation, which Stylet does not use: nothing here moves a device by itself.
//!
//! The interface grows, so recent functions and functions for some devices only may be missing. The
//! status array grew from 16 to 17 numbers, so [`STATUS_ROOM`] has more than any known version
//! writes.

#![allow(non_snake_case)]

use core::ffi::{c_char, c_double, c_int, c_uchar, c_uint, c_ushort};

use crate::library::{Driver, functions};

/// Number of a device, in the order of the system's list.
pub type Id = c_char;

/// Answer of a call that succeeded.
pub const GOOD: c_int = 0;
/// Answer for a repeated pose: the calls came too fast for the SDK.
pub const TIMEGUARD: c_int = 1;

/// Room for the status array.
pub const STATUS_ROOM: usize = 32;

/// Places in the status array.
pub mod status {
    /// The device has power.
    pub const POWER: usize = 0;
    /// The device is connected.
    pub const CONNECTED: usize = 1;
    /// The controller expects the handle at its rest position.
    pub const RESET: usize = 3;
    /// Forces are on.
    pub const FORCE: usize = 5;
    /// The controller has an error.
    pub const ERROR: usize = 9;
    /// Reason for the last loss of forces, a number of [`off_cause`](super::off_cause).
    pub const FORCE_OFF_CAUSE: usize = 14;
}

/// Reasons for forces that were turned off.
pub mod off_cause {
    /// No reason: they were not turned off.
    pub const NONE: i32 = 0;
    /// Button of the device.
    pub const BUTTON: i32 = 1;
    /// Excess speed of the handle.
    pub const VELOCITY: i32 = 2;
    /// Watchdog of the device.
    pub const WATCHDOG: i32 = 3;
    /// Request of a program.
    pub const SOFTWARE: i32 = 4;
    /// Loss of the cable.
    pub const USB: i32 = 5;
    /// Release of the handle.
    pub const DEADMAN: i32 = 6;
}

/// The library, and the names under which it is installed.
pub const DRIVER: Driver = Driver {
    name: "The Force Dimension SDK (libdrd.so or libdhd.so)",
    files: &["libdrd.so", "libdhd.so", "libdrd.so.3", "libdhd.so.3"],
};

functions! {
    required {
        fn dhdErrorGetLast() -> c_int;
        fn dhdGetDeviceCount() -> c_int;
        fn dhdOpenID(Id) -> c_int;
        fn dhdClose(Id) -> c_int;
        fn dhdStop(Id) -> c_int;
        fn dhdEnableForce(c_uchar, Id) -> c_int;
        fn dhdGetSystemType(Id) -> c_int;
        fn dhdGetStatus(*mut c_int, Id) -> c_int;
        fn dhdGetButtonMask(Id) -> c_uint;
        fn dhdGetPositionAndOrientationFrame(*mut c_double, *mut c_double, *mut c_double, *mut [c_double; 3], Id) -> c_int;
        fn dhdSetForceAndTorqueAndGripperForce(c_double, c_double, c_double, c_double, c_double, c_double, c_double, Id) -> c_int;
    }
    optional {
        fn dhdGetSDKVersion(*mut c_int, *mut c_int, *mut c_int, *mut c_int);
        fn dhdGetSystemName(Id) -> *const c_char;
        fn dhdGetSerialNumber(*mut c_ushort, Id) -> c_int;
        fn dhdHasActiveWrist(Id) -> bool;
        fn dhdGetComFreq(Id) -> c_double;
        fn dhdEnableExpertMode() -> c_int;
        fn dhdDisableExpertMode() -> c_int;
        fn dhdSetTimeGuard(c_int, Id) -> c_int;
        fn dhdSetWatchdog(c_uchar, Id) -> c_int;
        fn dhdGetWatchdog(*mut c_uchar, Id) -> c_int;
        fn dhdSetMaxForce(c_double, Id) -> c_int;
        fn dhdSetMaxTorque(c_double, Id) -> c_int;
    }
}
