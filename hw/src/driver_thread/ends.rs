//! Wait-free exchange of the newest sample and wrench between force loop and servo thread, with the
//! present fault.

use core::sync::atomic::{AtomicU32, Ordering};

use crate::device::{DeviceFault, DeviceInfo, Sample, Wrench};

/// Newest wrench, and the number of wrenches written so far.
#[derive(Debug, Clone, Copy, Default)]
pub struct Command {
    pub wrench: Wrench,
    pub number: u64,
}

/// The force loop's end.
pub struct ForceLoopEnd {
    samples: triple_buffer::Output<Option<Sample>>,
    commands: triple_buffer::Input<Command>,
    number: u64,
}

/// The servo thread's end.
pub struct ServoEnd {
    pub samples: triple_buffer::Input<Option<Sample>>,
    pub commands: triple_buffer::Output<Command>,
}

/// Creates both ends of a new exchange, without a sample and with zero force.
pub fn pair() -> (ForceLoopEnd, ServoEnd) {
    let (sample_in, sample_out) = triple_buffer::triple_buffer(&None);
    let (command_in, command_out) = triple_buffer::triple_buffer(&Command::default());
    let force_loop = ForceLoopEnd {
        samples: sample_out,
        commands: command_in,
        number: 0,
    };
    let servo = ServoEnd {
        samples: sample_in,
        commands: command_out,
    };
    (force_loop, servo)
}

impl ForceLoopEnd {
    /// Returns the newest sample, or the present fault.
    pub fn read(&mut self, fault: Option<DeviceFault>) -> Result<Sample, DeviceFault> {
        match fault {
            Some(fault) => Err(fault),
            None => self.samples.read().ok_or(DeviceFault::NotConnected),
        }
    }

    /// Passes `wrench` on, within the limits of the device. While `read` reports a fault, the servo
    /// thread exerts no force.
    pub fn write(&mut self, info: &DeviceInfo, wrench: &Wrench) -> Result<(), DeviceFault> {
        let finite = wrench.is_finite();
        self.number += 1;
        self.commands.write(Command {
            wrench: if finite { wrench.within(info) } else { Wrench::zero() },
            number: self.number,
        });
        if finite {
            Ok(())
        } else {
            Err(DeviceFault::NonFiniteWrench)
        }
    }
}

/// Present fault, written by the servo thread, or by the keeper while no servo thread runs.
#[derive(Debug)]
pub struct FaultCell(AtomicU32);

impl Default for FaultCell {
    fn default() -> Self {
        Self(AtomicU32::new(DeviceFault::NotConnected.code()))
    }
}

impl FaultCell {
    /// Returns the present fault.
    pub fn get(&self) -> Option<DeviceFault> {
        // SYNC: acquire pairs with the release in `set`: without a fault, the sample taken before is visible.
        match self.0.load(Ordering::Acquire) {
            0 => None,
            code => Some(DeviceFault::try_from(code).unwrap_or(DeviceFault::Driver)),
        }
    }

    /// Sets or clears the fault.
    pub fn set(&self, fault: Option<DeviceFault>) {
        // SYNC: release pairs with the acquire in `get`.
        self.0.store(fault.map_or(0, DeviceFault::code), Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_survives_the_round_trip_through_its_number() {
        let cell = FaultCell::default();
        assert_eq!(cell.get(), Some(DeviceFault::NotConnected));
        for code in 1..=9 {
            let fault = DeviceFault::try_from(code).expect("numbers 1 to 9 are faults");
            cell.set(Some(fault));
            assert_eq!(cell.get(), Some(fault));
        }
        cell.set(None);
        assert_eq!(cell.get(), None);
        assert!(DeviceFault::try_from(0).is_err() && DeviceFault::try_from(10).is_err());
    }
}
