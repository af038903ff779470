//! Conditions under which a servo thread exerts no force: a fault, a pause after it, or a stale
//! wrench.

use crate::device::{DeviceFault, Wrench};
use crate::driver_thread::ends::Command;

/// Age at which a wrench that is not renewed becomes zero, because its writer has stopped.
const DEAD_TIME_S: f64 = 0.1;
/// Time without a fault before the force returns.
const QUIET_TIME_S: f64 = 0.5;

/// Faults and age of the newest wrench, carried from one servo tick to the next.
#[derive(Debug, Default)]
pub struct Hold {
    fault: Option<DeviceFault>,
    /// Ticks since the last fault.
    quiet: u32,
    command_number: u64,
    /// Ticks since the last new command.
    unrenewed: u32,
}

impl Hold {
    /// Turns the force off. Keeps reporting the first fault until none has occurred for
    /// `QUIET_TIME_S`.
    pub fn pause(&mut self, fault: DeviceFault) {
        self.fault.get_or_insert(fault);
        self.quiet = 0;
    }

    /// Like [`pause`](Self::pause), for a lost connection. Replaces any other fault, because the
    /// pose is invalid as well.
    pub fn lose(&mut self, fault: DeviceFault) {
        self.fault = Some(fault);
        self.quiet = 0;
    }

    /// Returns the present fault.
    pub fn fault(&self) -> Option<DeviceFault> {
        self.fault
    }

    /// Returns the newest wrench; zero during a fault or when the wrench is stale.
    pub fn wrench(&mut self, command: &Command, servo_hz: u32) -> Wrench {
        let renewed = command.number != self.command_number;
        self.command_number = command.number;
        self.unrenewed = if renewed { 0 } else { self.unrenewed.saturating_add(1) };
        if lasts(self.unrenewed, DEAD_TIME_S, servo_hz) && command.wrench != Wrench::zero() {
            self.pause(DeviceFault::TimedOut);
        }
        if self.fault.is_some() {
            Wrench::zero()
        } else {
            command.wrench
        }
    }

    /// Ends a tick: clears a fault that has been absent for `QUIET_TIME_S`. Returns the remaining
    /// fault.
    pub fn end_tick(&mut self, servo_hz: u32) -> Option<DeviceFault> {
        self.quiet = self.quiet.saturating_add(1);
        if lasts(self.quiet, QUIET_TIME_S, servo_hz) {
            self.fault = None;
        }
        self.fault
    }
}

fn lasts(ticks: u32, time_s: f64, servo_hz: u32) -> bool {
    f64::from(ticks) >= time_s * f64::from(servo_hz)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    const HZ: u32 = 1000;

    fn push(number: u64) -> Command {
        let wrench = Wrench::from_force(Vector3::x());
        Command { wrench, number }
    }

    #[test]
    fn a_stale_wrench_becomes_zero_after_a_tenth_of_a_second() {
        let mut hold = Hold::default();
        for _ in 0..100 {
            assert_ne!(hold.wrench(&push(1), HZ), Wrench::zero());
        }
        assert_eq!(hold.wrench(&push(1), HZ), Wrench::zero());
        assert_eq!(hold.fault(), Some(DeviceFault::TimedOut));
        let mut hold = Hold::default();
        for _ in 0..1000 {
            hold.wrench(&Command::default(), HZ);
        }
        assert_eq!(hold.fault(), None);
    }

    #[test]
    fn the_first_fault_holds_until_half_a_second_passes_without_one() {
        let mut hold = Hold::default();
        hold.pause(DeviceFault::Overheated);
        hold.pause(DeviceFault::Driver);
        assert_eq!(hold.fault(), Some(DeviceFault::Overheated));
        hold.lose(DeviceFault::NotConnected);
        for tick in 1..500 {
            assert_eq!(hold.end_tick(HZ), Some(DeviceFault::NotConnected), "{tick}");
            assert_eq!(hold.wrench(&push(tick), HZ), Wrench::zero());
        }
        assert_eq!(hold.end_tick(HZ), None);
        assert_ne!(hold.wrench(&push(500), HZ), Wrench::zero());
    }
}
