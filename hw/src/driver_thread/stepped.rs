//! A device on the caller's thread and without a clock: each reading is a tick of the servo loop.
//!
//! Tests and measurements of faults use it, so that results do not depend on the machine. Ticks,
//! connection and errors are those of the device with threads.

use crate::device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use crate::driver_thread::ends::{self, ForceLoopEnd, ServoEnd};
use crate::driver_thread::shared::Shared;

/// Ticks between two attempts to connect.
const TICKS_BETWEEN_ATTEMPTS: u32 = 500;

/// Servo loop and its connection.
pub trait Step: Send {
    /// Reconnects; returns whether it succeeded.
    fn connect(&mut self, shared: &Shared) -> bool;
    /// Leaves zero force and closes the connection, if there is one.
    fn close(&mut self);
    /// Runs one servo tick.
    fn tick(&mut self, shared: &Shared);
    /// Returns whether the servo thread would run in this tick, instead of waiting in a driver
    /// call.
    fn runs(&mut self) -> bool {
        true
    }
}

/// Device that advances by one servo tick per reading.
pub struct Stepped<S: Step> {
    info: DeviceInfo,
    step: S,
    shared: Shared,
    end: ForceLoopEnd,
    connected: bool,
    unconnected: u32,
}

impl<S: Step> Stepped<S> {
    /// Creates a stepped device over the servo loop that `open` connects for the first time.
    pub(crate) fn over<E>(open: impl FnOnce(ServoEnd, &Shared) -> Result<(S, DeviceInfo), E>) -> Result<Self, E> {
        let (end, servo_end) = ends::pair();
        let shared = Shared::default();
        let (step, info) = open(servo_end, &shared)?;
        Ok(Self {
            info,
            step,
            shared,
            end,
            connected: true,
            unconnected: 0,
        })
    }

    fn tick(&mut self) {
        if self.connected && self.shared.errors.is_lost() {
            self.step.close();
            (self.connected, self.unconnected) = (false, 0);
        }
        if self.connected {
            self.step.tick(&self.shared);
            return;
        }
        self.unconnected += 1;
        if self.unconnected.is_multiple_of(TICKS_BETWEEN_ATTEMPTS) {
            self.connected = self.step.connect(&self.shared);
        }
    }
}

impl<S: Step> Device for Stepped<S> {
    fn info(&self) -> DeviceInfo {
        self.info
    }

    fn read(&mut self, _dt_s: f64) -> Result<Sample, DeviceFault> {
        if self.step.runs() {
            self.tick();
        }
        self.end.read(self.shared.fault.get())
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        self.end.write(&self.info, wrench)
    }
}

impl<S: Step> Drop for Stepped<S> {
    fn drop(&mut self) {
        self.step.close();
    }
}
