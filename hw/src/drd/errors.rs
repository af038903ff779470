//! The SDK's errors: number, name, and consequence for the force.

use crate::device::DeviceFault;
use crate::driver_thread::errors::{find, pause, reconnect};

pub use crate::driver_thread::errors::{KnownError, Response};

/// A call failed, and the SDK gives no other number.
pub const ERROR: u32 = 1;
/// Another program has the device.
pub const DEVICE_IN_USE: u32 = 20;

/// Every error of the interface but success.
pub const KNOWN: &[KnownError] = &[
    pause(ERROR, "DHD_ERROR", DeviceFault::Driver),
    reconnect(2, "DHD_ERROR_COM", DeviceFault::NotConnected),
    pause(3, "DHD_ERROR_DHC_BUSY", DeviceFault::TimedOut),
    reconnect(4, "DHD_ERROR_NO_DRIVER_FOUND", DeviceFault::NotConnected),
    reconnect(5, "DHD_ERROR_NO_DEVICE_FOUND", DeviceFault::NotConnected),
    pause(6, "DHD_ERROR_NOT_AVAILABLE", DeviceFault::Driver),
    reconnect(7, "DHD_ERROR_TIMEOUT", DeviceFault::TimedOut),
    pause(8, "DHD_ERROR_GEOMETRY", DeviceFault::Driver),
    pause(9, "DHD_ERROR_EXPERT_MODE_DISABLED", DeviceFault::Driver),
    pause(10, "DHD_ERROR_NOT_IMPLEMENTED", DeviceFault::Driver),
    reconnect(11, "DHD_ERROR_OUT_OF_MEMORY", DeviceFault::Driver),
    pause(12, "DHD_ERROR_DEVICE_NOT_READY", DeviceFault::NotCalibrated),
    pause(13, "DHD_ERROR_FILE_NOT_FOUND", DeviceFault::Driver),
    reconnect(14, "DHD_ERROR_CONFIGURATION", DeviceFault::Driver),
    reconnect(15, "DHD_ERROR_INVALID_INDEX", DeviceFault::NotConnected),
    pause(16, "DHD_ERROR_DEPRECATED", DeviceFault::Driver),
    pause(17, "DHD_ERROR_NULL_ARGUMENT", DeviceFault::Driver),
    pause(18, "DHD_ERROR_REDUNDANT_FAIL", DeviceFault::SafetyStop),
    pause(19, "DHD_ERROR_NOT_ENABLED", DeviceFault::Driver),
    reconnect(DEVICE_IN_USE, "DHD_ERROR_DEVICE_IN_USE", DeviceFault::Driver),
    pause(21, "DHD_ERROR_INVALID", DeviceFault::Driver),
    pause(22, "DHD_ERROR_NO_REGULATION", DeviceFault::Driver),
];

/// Returns the entry of `code`; an unknown number pauses the force as a driver's error.
pub fn known(code: u32) -> KnownError {
    find(KNOWN, code)
}

/// Returns the remedy for the error, as an instruction to the operator.
pub fn cure(code: u32) -> &'static str {
    match code {
        2 | 7 => "check power and USB cable of the device; it is reconnected automatically",
        4 => {
            "the SDK may not open the USB device: echo 'SUBSYSTEM==\"usb\", ATTR{idVendor}==\"1451\", TAG+=\"uaccess\"' | \
             sudo tee /etc/udev/rules.d/70-force-dimension.rules && sudo udevadm control --reload && sudo udevadm trigger"
        }
        5 | 15 => "plug the device in and switch it on; force-dimension:N takes the device with number N, from 0",
        12 => "calibrate the device as its manual says",
        18 => "the encoders of the device contradict each other: switch it off and on, and calibrate it",
        20 => "another program uses the device; close it",
        _ => "restart rt-core; if the error returns, report it with this number",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_run_from_1_to_22_and_each_has_its_own_name() {
        for (i, k) in KNOWN.iter().enumerate() {
            assert_eq!(k.code, i as u32 + 1);
            assert!(KNOWN[i + 1..].iter().all(|other| other.name != k.name));
            assert_eq!(known(k.code), *k);
        }
        assert_eq!(KNOWN.len(), 22);
        assert_eq!(known(99).response, Response::Pause);
    }
}
