//! A Force Dimension device, opened.

use std::path::PathBuf;

use crate::drd::connector::Connector;
use crate::drd::ffi::Api;
use crate::drd::servo::Servo;
use crate::drd::session::{ConnectionError, Description};
use crate::driver_thread::arm::Arm;
use crate::driver_thread::keeper::Report;
use crate::driver_thread::open;
use crate::driver_thread::served::Served;
use crate::placement::Placement;

/// Device to open, and its place in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct ForceDimensionConfig {
    /// The SDK's library; `None` tries its usual names.
    pub library: Option<PathBuf>,
    /// Number of the device, from 0, in the order of the system's list.
    pub number: u8,
    /// Place of the device in the world.
    pub placement: Placement,
    /// Rate of the servo thread, Hz.
    pub servo_hz: u32,
}

/// Reason why a device could not be opened; the text says what to do.
pub type OpenError = open::OpenError<ConnectionError>;

/// A Force Dimension device; see the module [`drd`](crate::drd). Dropping it leaves zero force and a stopped device.
pub type ForceDimension = Served<Description>;

impl ForceDimension {
    /// Loads the SDK and finds the device. `arm` runs once in each servo thread, before its first
    /// tick. `report` receives messages for the operator, from a thread of normal priority.
    ///
    /// A device that is not calibrated is opened too: it reads
    /// [`crate::DeviceFault::NotCalibrated`] until the operator has calibrated it.
    pub fn open(config: ForceDimensionConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        let api = Api::load(config.library.as_deref())?;
        Self::open_with(api, config, arm, report)
    }

    /// Like [`open`](Self::open), with a library that is already loaded.
    pub fn open_with(api: Api, config: ForceDimensionConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        Self::start("force-dimension", report, |shared, end| {
            let servo = Servo::new(api, config.placement, arm, end, config.servo_hz);
            Connector::new(api, config.number, shared, servo)
        })
    }
}
