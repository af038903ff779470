//! The contract between a force loop and a haptic device.
//!
//! A back end implements [`Device`]; `stylet_hw::conformance` checks its obligations.
//!
//! ```
//! use nalgebra::{UnitQuaternion, Vector3};
//! use stylet_device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
//!
//! /// A device at rest.
//! struct Still(u64);
//!
//! impl Device for Still {
//!     fn info(&self) -> DeviceInfo {
//!         DeviceInfo::phantom_premium_1_5()
//!     }
//!
//!     fn read(&mut self, _dt_s: f64) -> Result<Sample, DeviceFault> {
//!         self.0 += 1;
//!         Ok(Sample {
//!             tip_in_world: Vector3::zeros(),
//!             world_from_tool: UnitQuaternion::identity(),
//!             buttons: 0,
//!             sequence: self.0,
//!         })
//!     }
//!
//!     fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
//!         wrench.is_finite().then_some(()).ok_or(DeviceFault::NonFiniteWrench)
//!     }
//! }
//!
//! let mut device = Still(0);
//! assert!(device.read(1e-3).unwrap().is_finite());
//! assert_eq!(device.write(&Wrench::zero()), Ok(()));
//! ```

#![warn(missing_docs)]

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// A haptic device of six degrees of freedom, called once a tick from the force loop.
///
/// Obligations of every back end, checked by `stylet_hw::conformance`:
///
/// - after construction nothing allocates, locks, logs or panics, whatever the arguments are;
/// - [`read`](Device::read) returns within a quarter of a millisecond. A device that has nothing new
///   repeats its last sample with the same `sequence`; it never waits for the next one;
/// - every `Ok` sample is finite, and `sequence` never decreases;
/// - [`write`](Device::write) of [`Wrench::zero`] is accepted at any time, also after a fault;
/// - a wrench that is not finite is refused with [`DeviceFault::NonFiniteWrench`] and leaves zero force;
/// - a wrench past what the device can give keeps its direction and loses magnitude;
/// - the wrench holds until the next `write`, and a dropped device leaves zero force. A real device also
///   sets a wrench to zero that was not renewed for a tenth of a second.
pub trait Device: Send {
    /// Returns name and limits of the device, constant for its life.
    fn info(&self) -> DeviceInfo;

    /// Returns the newest pose. `dt_s` is the time since the last call; a simulated device advances
    /// by it, a real one ignores it.
    fn read(&mut self, dt_s: f64) -> Result<Sample, DeviceFault>;

    /// Sets the wrench that the device exerts on the operator, in the world frame, until the next
    /// call.
    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault>;

    /// Sets the goal to which a simulated hand moves the tip. A device held by a real hand ignores it.
    fn set_hand_goal(&mut self, _goal: &HandGoal) {}

    /// Sets the direction of the tool's +y, projected perpendicular to the goal's direction.
    /// Without it a simulated hand does not turn the tool about its axis. A device held by a real
    /// hand ignores it.
    fn set_hand_up(&mut self, _up: Option<Vector3<f64>>) {}

    /// Stops a simulated hand with the acceleration of its last goal. A device held by a real hand ignores it.
    fn stop_hand(&mut self) {}
}

/// Name and limits of a device.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DeviceInfo {
    /// Name for display; left out where the figures are saved.
    #[serde(skip)]
    pub name: &'static str,
    /// Largest force for a short time.
    pub peak_force_n: f64,
    /// Largest force for any time.
    pub continuous_force_n: f64,
    /// Largest torque; zero for a device without torques.
    pub peak_torque_nm: f64,
    /// Largest stiffness that the device can render.
    pub max_stiffness_n_per_m: f64,
    /// Smallest change of position that the encoders resolve, at the nominal pose.
    pub position_step_m: f64,
    /// True if no real hand holds the device.
    pub simulated: bool,
}

impl DeviceInfo {
    /// Returns the data sheet figures of the Phantom Premium 1.5 with six degrees of freedom.
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
    /// Position of the tip, m.
    pub tip_in_world: Vector3<f64>,
    /// Orientation of the tool; the needle lies along its +z, which points out of the handle
    /// towards the tip.
    pub world_from_tool: UnitQuaternion<f64>,
    /// One bit per button, bit 0 for the first.
    pub buttons: u32,
    /// Number of the reading; a repeated number marks a repeated sample.
    pub sequence: u64,
}

impl Sample {
    /// Returns whether position and orientation are finite.
    pub fn is_finite(&self) -> bool {
        self.tip_in_world.iter().all(|x| x.is_finite()) && self.world_from_tool.coords.iter().all(|x| x.is_finite())
    }

    /// Returns the unit vector along the needle, towards its tip.
    pub fn direction_in_world(&self) -> Vector3<f64> {
        self.world_from_tool * Vector3::z()
    }
}

/// Force and torque on the operator's hand, in the world frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    /// Force, N.
    pub force_n: Vector3<f64>,
    /// Torque, N m.
    pub torque_nm: Vector3<f64>,
}

impl Wrench {
    /// Returns zero force and torque.
    pub fn zero() -> Self {
        Self::default()
    }

    /// Creates a force without torque.
    pub fn from_force(force_n: Vector3<f64>) -> Self {
        Self {
            force_n,
            torque_nm: Vector3::zeros(),
        }
    }

    /// Returns the same directions, with force and torque limited to the peaks of the device.
    pub fn within(&self, info: &DeviceInfo) -> Self {
        Self {
            force_n: saturated(&self.force_n, info.peak_force_n),
            torque_nm: saturated(&self.torque_nm, info.peak_torque_nm),
        }
    }

    /// Returns whether force and torque are finite.
    pub fn is_finite(&self) -> bool {
        self.force_n.iter().chain(self.torque_nm.iter()).all(|x| x.is_finite())
    }
}

/// Returns the same direction, with the length limited to `limit`. Finite even if the square of the
/// length is not.
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

/// Goal of the simulated hand, and its limits on the way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HandGoal {
    /// Goal of the tip, m.
    pub tip_in_world: Vector3<f64>,
    /// Needle axis towards the tip, of any length but zero.
    pub direction: Vector3<f64>,
    /// Largest speed.
    pub speed_m_per_s: f64,
    /// Largest acceleration.
    pub acceleration_m_per_s2: f64,
}

impl HandGoal {
    /// Returns whether all values are finite, the direction is longer than 1e-9, and speed and
    /// acceleration are above zero.
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

/// Reason why a device could not read or write. The numbers are stable, because they appear in
/// records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, thiserror::Error, num_enum::TryFromPrimitive)]
#[repr(u32)]
pub enum DeviceFault {
    /// No device is connected.
    #[error("no device is connected")]
    NotConnected = 1,
    /// The device or the force loop is silent.
    #[error("the device did not answer in time")]
    TimedOut = 2,
    /// The pose is invalid.
    #[error("the device gave a position that is not a number")]
    NonFiniteSample = 3,
    /// The wrench is invalid.
    #[error("the requested force is not a number")]
    NonFiniteWrench = 4,
    /// The time since the last call is invalid.
    #[error("the requested period is not a positive number")]
    InvalidPeriod = 5,
    /// The operator has to calibrate the device.
    #[error("the device is not calibrated")]
    NotCalibrated = 6,
    /// The force is off until the motors have cooled.
    #[error("the motors of the device are too warm")]
    Overheated = 7,
    /// The driver turned the force off.
    #[error("the safety stop of the device is engaged")]
    SafetyStop = 8,
    /// Any other error of the driver.
    #[error("the driver of the device reports an error")]
    Driver = 9,
}

impl DeviceFault {
    /// Returns the stable number; `DeviceFault::try_from` is the inverse.
    pub const fn code(self) -> u32 {
        self as u32
    }
}
