//! What the status of the device means for the force.

use core::ffi::c_int;

use crate::device::DeviceFault;
use crate::drd::ffi::{STATUS_ROOM, off_cause, status};

/// The status array as the SDK fills it; what a shorter version leaves is zero.
pub type Status = [c_int; STATUS_ROOM];

/// What a status means for the force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Health {
    /// Nothing speaks against a force.
    Good,
    /// No force; the connection holds.
    Pause(DeviceFault),
    /// The device has turned its forces off. A program may turn them on again, or only the operator.
    Off {
        /// Why.
        fault: DeviceFault,
        /// A program may turn them on again.
        by_program: bool,
    },
    /// The connection is lost.
    Lost(DeviceFault),
}

/// `force_on` says whether forces were turned on. A number that is neither 0 nor 1 counts as the worse of both.
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
        // The operator's own stop, and what no known version has.
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
    fn each_number_that_speaks_against_a_force_is_heard() {
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
    fn the_operator_s_own_stop_is_left_to_the_operator() {
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
