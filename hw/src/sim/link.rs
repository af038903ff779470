//! A bad link between the loop and a device: late wrenches, lost wrenches, repeated samples.

use nalgebra::UnitQuaternion;
use nalgebra::Vector3;

use crate::device::{Device, DeviceFault, DeviceInfo, HandGoal, Sample, Wrench};

/// Largest delay of a wrench, in ticks.
pub const MAX_LATE: usize = 8;

/// Faults of the link. The default has none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinkFaults {
    /// Delay of each wrench in ticks, at most `MAX_LATE`.
    pub late_ticks: usize,
    /// Number of wrenches in a thousand that are lost: the device continues with the previous one.
    pub lost_per_thousand: u32,
    /// Number of samples in a thousand that are repeated, with their old sequence number.
    pub repeated_per_thousand: u32,
}

/// A device behind a bad link. The same calls give the same faults.
#[derive(Debug, Clone)]
pub struct BadLink<D> {
    /// The device behind the link.
    pub device: D,
    faults: LinkFaults,
    /// Newest first.
    in_flight: [Wrench; MAX_LATE + 1],
    last: Sample,
    random_state: u32,
}

impl<D: Device> BadLink<D> {
    /// Puts `device` behind a link with these faults.
    pub fn new(device: D, faults: LinkFaults) -> Self {
        Self {
            device,
            faults,
            in_flight: [Wrench::zero(); MAX_LATE + 1],
            last: Sample {
                tip_in_world: Vector3::zeros(),
                world_from_tool: UnitQuaternion::identity(),
                buttons: 0,
                sequence: 0,
            },
            random_state: 1,
        }
    }

    fn happens(&mut self, per_thousand: u32) -> bool {
        // xorshift32 with a fixed seed: the figures of the hard cases and of the stiffest walls are of these numbers.
        self.random_state ^= self.random_state << 13;
        self.random_state ^= self.random_state >> 17;
        self.random_state ^= self.random_state << 5;
        self.random_state % 1000 < per_thousand
    }
}

impl<D: Device> Device for BadLink<D> {
    fn info(&self) -> DeviceInfo {
        self.device.info()
    }

    fn read(&mut self, dt_s: f64) -> Result<Sample, DeviceFault> {
        let sample = self.device.read(dt_s)?;
        let repeats = self.last.sequence > 0 && self.happens(self.faults.repeated_per_thousand);
        if !repeats {
            self.last = sample;
        }
        Ok(self.last)
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        if !wrench.is_finite() {
            // The device refuses it at once, and no wrench in flight arrives.
            self.in_flight = [Wrench::zero(); MAX_LATE + 1];
            return self.device.write(wrench);
        }
        self.in_flight.rotate_right(1);
        self.in_flight[0] = *wrench;
        let arrived = self.in_flight[self.faults.late_ticks.min(MAX_LATE)];
        if self.happens(self.faults.lost_per_thousand) {
            return Ok(());
        }
        self.device.write(&arrived)
    }

    fn set_hand_goal(&mut self, goal: &HandGoal) {
        self.device.set_hand_goal(goal);
    }

    fn set_hand_up(&mut self, up: Option<Vector3<f64>>) {
        self.device.set_hand_up(up);
    }

    fn stop_hand(&mut self) {
        self.device.stop_hand();
    }
}
