//! What the force loop asks of a haptic device, and what it may rely on.

use core::fmt;

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// A haptic device of six degrees of freedom, called once a tick from the force loop.
///
/// Obligations of every back end, each held by the conformance tests:
///
/// - after construction nothing allocates, locks, logs or panics, whatever the arguments are;
/// - [`read`](Device::read) returns within a quarter of a millisecond. A device that has nothing new
///   repeats its last sample with the same `sequence`; it never waits for the next one;
/// - every `Ok` sample is finite, and `sequence` never decreases;
/// - [`write`](Device::write) of [`Wrench::zero`] is accepted at any time, also after a fault;
/// - a wrench that is not finite is refused with [`DeviceFault::NonFiniteWrench`] and leaves zero force;
/// - a wrench past what the device can give keeps its direction and loses magnitude;
/// - the wrench holds until the next `write`, and a dropped device leaves zero force. A real device also lets go of
///   a wrench that was not renewed for a tenth of a second.
///
/// ```
/// use stylet_hw::{Device, SimulatedPhantom, SimulatedPhantomConfig, Wrench};
/// let mut device = SimulatedPhantom::new(SimulatedPhantomConfig::default());
/// let sample = device.read(1e-3).unwrap();
/// device.write(&Wrench::zero()).unwrap();
/// assert!(sample.is_finite() && device.info().simulated);
/// ```
pub trait Device: Send {
    /// What the device is and how far it can be trusted. Constant for the life of the device.
    fn info(&self) -> DeviceInfo;

    /// The newest pose. `dt_s` is the time since the last call; a simulated device advances by it, a real
    /// one ignores it.
    fn read(&mut self, dt_s: f64) -> Result<Sample, DeviceFault>;

    /// The wrench that the device exerts on the operator, in the world frame, until the next call.
    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault>;

    /// Where a simulated hand should take the tip. A device held by a real hand ignores it.
    fn set_hand_goal(&mut self, _goal: &HandGoal) {}

    /// A simulated hand stops where it is, as fast as its last goal lets it. A device held by a real hand ignores it.
    fn stop_hand(&mut self) {}
}

/// The figures of a device that limit what the force loop may ask of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceInfo {
    pub name: &'static str,
    pub peak_force_n: f64,
    pub continuous_force_n: f64,
    pub peak_torque_nm: f64,
    pub max_stiffness_n_per_m: f64,
    /// The smallest change of position that the encoders can show, at the nominal pose.
    pub position_step_m: f64,
    pub simulated: bool,
}

impl DeviceInfo {
    /// Phantom Premium 1.5 with six degrees of freedom: figures of its data sheet.
    pub const fn phantom_premium_1_5() -> Self {
        Self {
            name: "Phantom Premium 1.5 6DOF",
            peak_force_n: 8.5,
            continuous_force_n: 1.4,
            peak_torque_nm: 0.188,
            max_stiffness_n_per_m: 800.0,
            position_step_m: 3e-5,
            simulated: false,
        }
    }
}

/// One reading of the device.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    pub tip_in_world: Vector3<f64>,
    /// The needle lies along +z of the tool frame, pointing out of the handle towards the tip.
    pub world_from_tool: UnitQuaternion<f64>,
    /// One bit a button, bit 0 the first.
    pub buttons: u32,
    /// Grows with each new reading: the same number twice means a repeated sample.
    pub sequence: u64,
}

impl Sample {
    pub fn is_finite(&self) -> bool {
        self.tip_in_world.iter().all(|x| x.is_finite()) && self.world_from_tool.coords.iter().all(|x| x.is_finite())
    }

    /// Unit vector along the needle, towards its tip.
    pub fn direction_in_world(&self) -> Vector3<f64> {
        self.world_from_tool * Vector3::z()
    }
}

/// Force and torque on the operator's hand, in the world frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    pub force_n: Vector3<f64>,
    pub torque_nm: Vector3<f64>,
}

impl Wrench {
    pub fn zero() -> Self {
        Self {
            force_n: Vector3::zeros(),
            torque_nm: Vector3::zeros(),
        }
    }

    pub fn from_force(force_n: Vector3<f64>) -> Self {
        Self {
            force_n,
            torque_nm: Vector3::zeros(),
        }
    }

    /// The same directions, with no more force and torque than the device can give.
    pub fn within(&self, info: &DeviceInfo) -> Self {
        Self {
            force_n: saturated(&self.force_n, info.peak_force_n),
            torque_nm: saturated(&self.torque_nm, info.peak_torque_nm),
        }
    }

    pub fn is_finite(&self) -> bool {
        self.force_n.iter().chain(self.torque_nm.iter()).all(|x| x.is_finite())
    }
}

impl Default for Wrench {
    fn default() -> Self {
        Self::zero()
    }
}

/// The same direction, no longer than `limit`. Finite also where the square of the length is not.
fn saturated(v: &Vector3<f64>, limit: f64) -> Vector3<f64> {
    let largest = v.amax();
    if largest <= 0.0 {
        return Vector3::zeros();
    }
    let scaled = v / largest;
    let size = scaled.norm();
    if size * largest <= limit {
        *v
    } else {
        scaled * (limit / size)
    }
}

/// Where the simulated hand should go, and how.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HandGoal {
    pub tip_in_world: Vector3<f64>,
    /// Needle axis towards the tip; any length but zero.
    pub direction: Vector3<f64>,
    pub speed_m_per_s: f64,
    pub acceleration_m_per_s2: f64,
}

impl HandGoal {
    /// Finite, a direction to speak of, and a speed and an acceleration above zero.
    pub fn is_valid(&self) -> bool {
        let finite = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
        let positive = |x: f64| x.is_finite() && x > 0.0;
        finite(&self.tip_in_world)
            && finite(&self.direction)
            && self.direction.norm() > 1e-9
            && positive(self.speed_m_per_s)
            && positive(self.acceleration_m_per_s2)
    }
}

/// Why a device could not do what it was asked. The numbers are stable: they appear in records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u32)]
pub enum DeviceFault {
    NotConnected = 1,
    TimedOut = 2,
    NonFiniteSample = 3,
    NonFiniteWrench = 4,
    InvalidPeriod = 5,
    NotCalibrated = 6,
    Overheated = 7,
    SafetyStop = 8,
    Driver = 9,
}

impl DeviceFault {
    pub const fn code(self) -> u32 {
        self as u32
    }
}

impl fmt::Display for DeviceFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotConnected => "no device is connected",
            Self::TimedOut => "the device did not answer in time",
            Self::NonFiniteSample => "the device gave a position that is not a number",
            Self::NonFiniteWrench => "the force asked for is not a number",
            Self::InvalidPeriod => "the period asked for is not a positive number",
            Self::NotCalibrated => "the device is not calibrated",
            Self::Overheated => "the motors of the device are too warm",
            Self::SafetyStop => "the safety stop of the device is engaged",
            Self::Driver => "the driver of the device reports an error",
        })
    }
}

impl core::error::Error for DeviceFault {}
