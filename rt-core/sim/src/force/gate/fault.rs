//! Faults that bring the force to zero, and counts of each limit's interventions.

use serde::{Deserialize, Serialize};

/// Why the force goes to zero. The numbers are stable: they appear in records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[repr(u32)]
pub enum ForceFault {
    /// The force law returned a force that is not a number.
    #[error("the force law gave a force that is not a number")]
    NonFiniteForce = 1,
    /// The device reported a fault.
    #[error("the device reported a fault")]
    DeviceFault = 2,
    /// The device repeats an old sample.
    #[error("the device repeats an old sample")]
    StaleDevice = 3,
    /// The tissue has not answered in time.
    #[error("the tissue has not answered in time")]
    StaleTissue = 4,
    /// The force loop missed its deadlines.
    #[error("the force loop missed its deadlines")]
    Overrun = 5,
    /// The operator stopped the force.
    #[error("the operator stopped the force")]
    Stopped = 6,
}

impl ForceFault {
    /// Its number in records.
    pub const fn code(self) -> u32 {
        self as u32
    }
}

/// Count of interventions of each limit, in the order of the gate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct GateCounts {
    /// Forces that were not finite.
    pub non_finite: u64,
    /// Ticks in debt of energy.
    pub passivity: u64,
    /// Ticks with a force cut by the slew limit.
    pub slew_limited: u64,
    /// Ticks with a force cut by the limit of the settings.
    pub magnitude_limited: u64,
    /// Ticks with a force cut since the motors are warm.
    pub thermal_limited: u64,
    /// Ticks with a force or torque cut by the device's own limit.
    pub device_limited: u64,
    /// Ticks with a torque cut by slew or size.
    pub torque_limited: u64,
    /// Faults, each counted once until it is cleared.
    pub faults: u64,
}

impl GateCounts {
    /// Returns the counts in the order of the fields.
    pub fn all(&self) -> [u64; 8] {
        let c = self;
        [
            c.non_finite,
            c.passivity,
            c.slew_limited,
            c.magnitude_limited,
            c.thermal_limited,
            c.device_limited,
            c.torque_limited,
            c.faults,
        ]
    }
}
