//! A test device that fails on command, for every loop that owns a device.

use nalgebra::Vector3;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use stylet_hw::{Device, DeviceFault, DeviceInfo, HandGoal, Sample, SimulatedPhantom, SimulatedPhantomConfig, Wrench};

/// Kind of failure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cause {
    Nothing,
    Silent,
    ReadFails,
    NotANumber,
    WriteFails,
    TissueStops,
    TissueUnsolved,
    Late,
    ForceNotANumber,
    Lost,
}

/// A simulated hand on a device that fails on command.
pub struct BreakingDevice {
    hand: SimulatedPhantom,
    cause: Arc<AtomicU32>,
    last: Option<Sample>,
}

impl BreakingDevice {
    /// Returns the device with its tip at the start, and the switch for its failure.
    pub fn at(start_tip_in_world: Vector3<f64>) -> (Self, Arc<AtomicU32>) {
        let cause = Arc::new(AtomicU32::new(Cause::Nothing as u32));
        let hand = SimulatedPhantom::new(SimulatedPhantomConfig {
            start_tip_in_world,
            ..SimulatedPhantomConfig::default()
        });
        let device = Self {
            hand,
            cause: Arc::clone(&cause),
            last: None,
        };
        (device, cause)
    }

    fn has(&self, cause: Cause) -> bool {
        self.cause.load(Ordering::Relaxed) == cause as u32
    }
}

impl Device for BreakingDevice {
    fn info(&self) -> DeviceInfo {
        self.hand.info()
    }

    fn read(&mut self, dt_s: f64) -> Result<Sample, DeviceFault> {
        if self.has(Cause::ReadFails) {
            return Err(DeviceFault::TimedOut);
        }
        if self.has(Cause::Lost) {
            return Err(DeviceFault::NotConnected);
        }
        if let (true, Some(last)) = (self.has(Cause::Silent), self.last) {
            return Ok(last);
        }
        let mut sample = self.hand.read(dt_s)?;
        self.last = Some(sample);
        if self.has(Cause::NotANumber) {
            sample.tip_in_world.x = f64::NAN;
        }
        Ok(sample)
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        self.hand.write(wrench)?;
        if self.has(Cause::WriteFails) {
            Err(DeviceFault::Driver)
        } else {
            Ok(())
        }
    }

    fn set_hand_goal(&mut self, goal: &HandGoal) {
        self.hand.set_hand_goal(goal);
    }

    fn set_hand_up(&mut self, up: Option<Vector3<f64>>) {
        self.hand.set_hand_up(up);
    }

    fn stop_hand(&mut self) {
        self.hand.stop_hand();
    }
}
