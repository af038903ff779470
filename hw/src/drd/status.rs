//! Interpretation of the device's status for the force.

use core::ffi::c_int;

use crate::device::DeviceFault;
use crate::drd::ffi::{STATUS_ROOM, off_cause, status};

/// Status array as the SDK fills it; numbers that a shorter version omits are zero.
pub type Status = [c_int; STATUS_ROOM];

/// Consequence of a status for the force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Health {
    /// Ready for a force.
    Good,
    /// Force off; the connection holds.
    Pause(DeviceFault),
    /// Forces turned off by the device.
    Off {
        /// Reason.
        fault: DeviceFault,
        /// True if a program may turn them on again; otherwise only the operator may.
        by_program: bool,
    },
    /// The connection is lost.
    Lost(DeviceFault),
}

/// Interprets a status. `force_on` says whether forces were turned on. A number that is neither 0
/// nor 1 counts as the worse of both.
pub fn health(numbers: &Status, force_on: bool) -> Health {
    let on = |place: usize| numbers[place] == 1;
    if !on(status::CONNECTED) || !on(status::POWER) {
        Health::Lost(DeviceFault::NotConnected)
    } else if numbers[status::ERROR] != 0 {
        Health::Lost(DeviceFault::Driver)
    } else if numbers[status::RESET] != 0 {
        Health::Pause(DeviceFault::NotCalibrated)
    } else if force_on && !on(status::FORCE) {
        off(numbers[status::FORCE_OFF_CAUSE])
    } else {
        Health::Good
    }
}

fn off(cause: c_int) -> Health {
    let off = |fault, by_program| Health::Off { fault, by_program };
    match cause {
        off_cause::USB => Health::Lost(DeviceFault::NotConnected),
        off_cause::WATCHDOG => off(DeviceFault::TimedOut, true),
        off_cause::VELOCITY => off(DeviceFault::SafetyStop, true),
        off_cause::NONE | off_cause::SOFTWARE => off(DeviceFault::Driver, true),
        // The operator's own stop, and causes that no known version has.
        _ => off(DeviceFault::SafetyStop, false),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> Status {
        let mut numbers = [0; STATUS_ROOM];
        for place in [status::POWER, status::CONNECTED, 2, status::FORCE] {
            numbers[place] = 1;
        }
        numbers
    }

    #[test]
    fn every_adverse_status_turns_the_force_off() {
        assert_eq!(health(&good(), true), Health::Good);
        let with = |place: usize, number: c_int| {
            let mut numbers = good();
            numbers[place] = number;
            health(&numbers, true)
        };
        for number in [0, -1, 2, c_int::MAX] {
            assert_eq!(with(status::POWER, number), Health::Lost(DeviceFault::NotConnected));
            assert_eq!(with(status::CONNECTED, number), Health::Lost(DeviceFault::NotConnected));
            assert!(matches!(with(status::FORCE, number), Health::Off { .. }), "{number}");
        }
        for number in [1, -1, 2] {
            assert_eq!(with(status::ERROR, number), Health::Lost(DeviceFault::Driver));
            assert_eq!(with(status::RESET, number), Health::Pause(DeviceFault::NotCalibrated));
        }
        assert_eq!(
            health(&[0; STATUS_ROOM], false),
            Health::Lost(DeviceFault::NotConnected)
        );
    }

    #[test]
    fn only_the_operator_ends_the_operator_s_stop() {
        let mut numbers = good();
        numbers[status::FORCE] = 0;
        for (cause, by_program) in [
            (off_cause::NONE, true),
            (off_cause::BUTTON, false),
            (off_cause::VELOCITY, true),
            (off_cause::WATCHDOG, true),
            (off_cause::SOFTWARE, true),
            (off_cause::DEADMAN, false),
            (7, false),
        ] {
            numbers[status::FORCE_OFF_CAUSE] = cause;
            let Health::Off { by_program: said, .. } = health(&numbers, true) else {
                panic!("{cause}")
            };
            assert_eq!(said, by_program, "{cause}");
        }
        numbers[status::FORCE_OFF_CAUSE] = off_cause::USB;
        assert_eq!(health(&numbers, true), Health::Lost(DeviceFault::NotConnected));
        assert_eq!(health(&numbers, false), Health::Good, "not turned on yet");
    }
}
