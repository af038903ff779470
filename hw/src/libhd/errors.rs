//! The driver's errors: number, name, and consequence for the force.

use crate::device::DeviceFault;
use crate::driver_thread::errors::{find, pause, reconnect};

pub use crate::driver_thread::errors::{KnownError, Response};

/// No error.
pub const SUCCESS: u32 = 0;
/// The device is in use.
pub const DEVICE_ALREADY_INITIATED: u32 = 0x0301;

/// Every error of the interface but success.
pub const KNOWN: &[KnownError] = &[
    pause(0x0100, "HD_INVALID_ENUM", DeviceFault::Driver),
    pause(0x0101, "HD_INVALID_VALUE", DeviceFault::Driver),
    pause(0x0102, "HD_INVALID_OPERATION", DeviceFault::Driver),
    pause(0x0103, "HD_INVALID_INPUT_TYPE", DeviceFault::Driver),
    reconnect(0x0104, "HD_BAD_HANDLE", DeviceFault::NotConnected),
    pause(0x0200, "HD_WARM_MOTORS", DeviceFault::Overheated),
    pause(0x0201, "HD_EXCEEDED_MAX_FORCE", DeviceFault::SafetyStop),
    pause(0x0202, "HD_EXCEEDED_MAX_FORCE_IMPULSE", DeviceFault::SafetyStop),
    pause(0x0203, "HD_EXCEEDED_MAX_VELOCITY", DeviceFault::SafetyStop),
    pause(0x0204, "HD_FORCE_ERROR", DeviceFault::SafetyStop),
    reconnect(0x0300, "HD_DEVICE_FAULT", DeviceFault::NotConnected),
    reconnect(
        DEVICE_ALREADY_INITIATED,
        "HD_DEVICE_ALREADY_INITIATED",
        DeviceFault::Driver,
    ),
    reconnect(0x0302, "HD_COMM_ERROR", DeviceFault::NotConnected),
    reconnect(0x0303, "HD_COMM_CONFIG_ERROR", DeviceFault::NotConnected),
    reconnect(0x0304, "HD_TIMER_ERROR", DeviceFault::TimedOut),
    pause(0x0400, "HD_ILLEGAL_BEGIN", DeviceFault::Driver),
    pause(0x0401, "HD_ILLEGAL_END", DeviceFault::Driver),
    pause(0x0402, "HD_FRAME_ERROR", DeviceFault::Driver),
    reconnect(0x0500, "HD_INVALID_PRIORITY", DeviceFault::Driver),
    reconnect(0x0501, "HD_SCHEDULER_FULL", DeviceFault::Driver),
    reconnect(0x0600, "HD_INVALID_LICENSE", DeviceFault::Driver),
];

/// Returns the entry of `code`; an unknown number pauses the force as a driver's error.
pub fn known(code: u32) -> KnownError {
    find(KNOWN, code)
}

/// Returns the remedy for the error, as an instruction to the operator.
pub fn cure(code: u32) -> &'static str {
    match code {
        0x0200 => "let the motors cool for some minutes; lower the force scale",
        0x0201..=0x0204 => "move slower and re-arm; lower the force limits if it returns",
        0x0104 | 0x0300 | 0x0302 => "check power and cable of the device; it is reconnected automatically",
        0x0303 => "check the parallel port: mode EPP in the BIOS, and that no other program uses it",
        0x0301 => "another program uses the device; close it",
        0x0304 => "the driver has no timer; check that its kernel interface is loaded",
        0x0600 => "install the OpenHaptics licence of this PC",
        _ => "restart rt-core; if the error returns, report it with this number",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_error_has_one_entry_and_only_a_lost_connection_reconnects() {
        for (i, k) in KNOWN.iter().enumerate() {
            assert!(
                KNOWN[i + 1..]
                    .iter()
                    .all(|other| other.code != k.code && other.name != k.name)
            );
            assert_eq!(known(k.code), *k);
        }
        assert_eq!(KNOWN.len(), 21);
        assert_eq!(known(0x0302).response, Response::Reconnect);
        assert_eq!(known(0x0200).fault, DeviceFault::Overheated);
        assert_eq!(known(0xBEEF).response, Response::Pause);
    }
}
