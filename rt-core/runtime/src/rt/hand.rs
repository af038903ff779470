//! A hand and the device that it holds: everything that the needle's loop and the second device's loop have in common.

use crate::rt::clock::Wait;
use crate::rt::exchange::{Happened, Moved};
use crate::rt::motion_lease::{self, Lapse, MotionLease, Promise};
use crate::rt::timing::Probe;
use crate::rt::watchdog::{Watchdog, device_fault};
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use stylet_hw::{Device, DeviceFault, DeviceInfo, HandGoal, Sample, Wrench};
use stylet_shm_schema::Fault;

/// Largest distance from its goal at which a resting hand has arrived.
const AT_GOAL_M: f64 = 4e-4;
const AT_REST_M_PER_S: f64 = 3e-3;
/// The mark at which the device read begins.
const READ_MARK: usize = 0;

/// State of a hand between ticks.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct HandMemory {
    /// Last good sample of the device.
    pub sample: Option<Sample>,
    /// Goal of the simulated hand.
    pub goal: Option<HandGoal>,
    /// Direction of the tool's +y for the goal.
    pub up: Option<Vector3<f64>>,
    /// Lease of the motion that a host ordered.
    pub motion: MotionLease,
    /// Watchdog with its latched fault.
    pub watchdog: Watchdog,
}

/// The device's answers to the last read and the last write, for the recording.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct DeviceAnswer {
    /// Answer to the read.
    pub read: Result<Sample, DeviceFault>,
    /// The device rejected the force.
    pub write_failed: bool,
}

impl Default for DeviceAnswer {
    /// Answer of a device that is not there.
    fn default() -> Self {
        Self {
            read: Err(DeviceFault::NotConnected),
            write_failed: false,
        }
    }
}

/// A device in its loop.
pub struct HandDevice {
    device: Box<dyn Device>,
    /// Properties of the device.
    pub info: DeviceInfo,
    /// Time between two ticks, s.
    pub period_s: f64,
    /// Answer of this tick.
    pub answer: DeviceAnswer,
    /// Present in a measurement.
    pub probe: Option<Box<Probe>>,
    /// Wait of the loop for each deadline.
    pub wait: Wait,
}

impl HandDevice {
    pub(super) fn new(device: Box<dyn Device>, period_s: f64) -> Self {
        Self {
            info: device.info(),
            device,
            period_s,
            answer: DeviceAnswer::default(),
            probe: None,
            wait: Wait::default(),
        }
    }

    /// Ends a stage of the tick, in a measurement.
    pub(super) fn mark(&mut self) {
        if let Some(probe) = &mut self.probe {
            probe.mark();
        }
    }

    /// Reads the device.
    pub(super) fn read(&mut self) -> Result<Sample, DeviceFault> {
        self.answer.read = self.device.read(self.period_s);
        self.answer.read
    }

    /// Writes the wrench; true if the device rejected it.
    pub(super) fn write(&mut self, wrench: &Wrench) -> bool {
        self.answer.write_failed = self.device.write(wrench).is_err();
        self.answer.write_failed
    }

    /// Ends the stage of the write and takes the time since the read began, in a measurement.
    pub(super) fn mark_output(&mut self) {
        if let Some(probe) = &mut self.probe {
            probe.mark();
            probe.output_since_mark(READ_MARK);
        }
    }

    /// Writes zero force.
    pub(super) fn end(&mut self) {
        let _ = self.device.write(&Wrench::zero());
    }

    fn brake(&mut self, goal: &HandGoal, sample: Option<Sample>, velocity_m_per_s: &Vector3<f64>) {
        motion_lease::brake(self.device.as_mut(), goal, sample, velocity_m_per_s);
    }
}

impl HandMemory {
    /// Takes the device's answer: returns the newest sample, the last good one when the device has a fault, and the
    /// faults found.
    pub(super) fn judge(&mut self, answer: Result<Sample, DeviceFault>) -> (Sample, [Option<Fault>; 2]) {
        let last = self.sample.unwrap_or(Sample {
            tip_in_world: Vector3::zeros(),
            world_from_tool: UnitQuaternion::identity(),
            buttons: 0,
            sequence: 0,
        });
        let (sample, fault) = match answer {
            Ok(sample) if sample.is_finite() => (sample, None),
            Ok(_) => (last, Some(Fault::NonFiniteInput)),
            Err(fault) => (last, Some(device_fault(fault))),
        };
        let is_repeated = self.sample.is_some_and(|before| before.sequence == sample.sequence);
        (sample, [fault, self.watchdog.sample(is_repeated)])
    }

    /// Begins a motion. A real hand follows no goal, and needs no lease.
    pub(super) fn begin_motion(
        &mut self,
        hand: &mut HandDevice,
        goal: HandGoal,
        up: Option<Vector3<f64>>,
        promise: Option<Promise>,
    ) {
        (self.goal, self.up) = (Some(goal), up);
        self.follow_goal(hand);
        let promise = promise.filter(|_| hand.info.simulated);
        self.motion = MotionLease::begin(promise, hand.period_s);
    }

    fn follow_goal(&self, hand: &mut HandDevice) {
        if let Some(goal) = &self.goal {
            hand.device.set_hand_up(self.up);
            hand.device.set_hand_goal(goal);
        }
    }

    /// Stops the motion as hard as when its lease lapses. `sample` is in device coordinates.
    pub(super) fn stop_motion(
        &mut self,
        hand: &mut HandDevice,
        sample: Option<Sample>,
        velocity_m_per_s: &Vector3<f64>,
    ) {
        match &self.goal {
            Some(goal) => hand.brake(goal, sample, velocity_m_per_s),
            None => hand.device.stop_hand(),
        }
        self.goal = None;
        self.motion = MotionLease::Free;
    }

    /// Takes a promise, which may resume a lapsed motion.
    pub(super) fn keep_moving(&mut self, hand: &mut HandDevice, promise: &Promise) {
        let promise = promise.limited_to_travel(self.goal.map_or(0.0, |goal| goal.speed_m_per_s));
        if self.motion.renew(&promise, hand.period_s) {
            self.follow_goal(hand);
        }
    }

    /// Brakes a motion whose lease has lapsed; returns the notice of one that is given up at last. `sample` is in device
    /// coordinates.
    pub(super) fn watch_motion(
        &mut self,
        hand: &mut HandDevice,
        sample: Option<Sample>,
        velocity_m_per_s: &Vector3<f64>,
        what: Moved,
    ) -> Option<Happened> {
        let has_arrived = self.has_arrived(sample, velocity_m_per_s);
        match (self.motion.tick(has_arrived, hand.period_s)?, &self.goal) {
            (Lapse::Brake, Some(goal)) => hand.brake(goal, sample, velocity_m_per_s),
            (Lapse::Brake, None) => {}
            (Lapse::GiveUp, _) => {
                self.goal = None;
                return Some(Happened::MotionGivenUp(what));
            }
        }
        None
    }

    fn has_arrived(&self, sample: Option<Sample>, velocity_m_per_s: &Vector3<f64>) -> bool {
        let (Some(goal), Some(sample)) = (&self.goal, sample) else {
            return self.goal.is_none();
        };
        self.is_at_goal(&sample.tip_in_world, velocity_m_per_s.norm())
            && motion_lease::is_turned(goal, self.up, &sample.world_from_tool)
    }

    /// True if a simulated hand rests at its goal, with its tip there in device coordinates.
    pub(super) fn is_at_goal(&self, tip: &Vector3<f64>, speed_m_per_s: f64) -> bool {
        self.goal
            .is_some_and(|goal| (tip - goal.tip_in_world).norm() < AT_GOAL_M && speed_m_per_s < AT_REST_M_PER_S)
    }
}
