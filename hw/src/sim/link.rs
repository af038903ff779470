//! A bad link between the loop and a device: late wrenches, lost wrenches, repeated samples.

use nalgebra::UnitQuaternion;
use nalgebra::Vector3;

use crate::device::{Device, DeviceFault, DeviceInfo, HandGoal, Sample, Wrench};

/// Wrenches that can be under way.
pub const MAX_LATE: usize = 8;

/// What the link does. The default is a good one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinkFaults {
    /// Ticks that each wrench takes to arrive, at most `MAX_LATE`.
    pub late_ticks: usize,
    /// Of a thousand wrenches so many are lost: the device goes on with the one before.
    pub lost_per_thousand: u32,
    /// Of a thousand samples so many are repeated, with their old sequence number.
    pub repeated_per_thousand: u32,
}

/// A device behind a bad link. The same calls give the same faults.
#[derive(Debug, Clone)]
pub struct BadLink<D> {
    pub device: D,
    faults: LinkFaults,
    /// Newest first.
    under_way: [Wrench; MAX_LATE + 1],
    last: Sample,
    dice: u32,
}

impl<D: Device> BadLink<D> {
    pub fn new(device: D, faults: LinkFaults) -> Self {
        Self {
            device,
            faults,
            under_way: [Wrench::zero(); MAX_LATE + 1],
            last: Sample {
                tip_in_world: Vector3::zeros(),
                world_from_tool: UnitQuaternion::identity(),
                buttons: 0,
                sequence: 0,
            },
            dice: 1,
        }
    }

    fn happens(&mut self, per_thousand: u32) -> bool {
        // xorshift32: fixed seed, so that a session can be repeated.
        self.dice ^= self.dice << 13;
        self.dice ^= self.dice >> 17;
        self.dice ^= self.dice << 5;
        self.dice % 1000 < per_thousand
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
            // Refused at once, and nothing of what was under way arrives.
            self.under_way = [Wrench::zero(); MAX_LATE + 1];
            return self.device.write(wrench);
        }
        self.under_way.rotate_right(1);
        self.under_way[0] = *wrench;
        let arrived = self.under_way[self.faults.late_ticks.min(MAX_LATE)];
        if self.happens(self.faults.lost_per_thousand) {
            return Ok(());
        }
        self.device.write(&arrived)
    }

    fn set_hand_goal(&mut self, goal: &HandGoal) {
        self.device.set_hand_goal(goal);
    }

    fn stop_hand(&mut self) {
        self.device.stop_hand();
    }
}
