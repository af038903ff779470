//! A Force Dimension device, opened.

use std::path::PathBuf;

use crate::beside::arm::Arm;
use crate::beside::keeper::Report;
use crate::beside::open;
use crate::beside::served::Served;
use crate::drd::connector::Connector;
use crate::drd::ffi::Api;
use crate::drd::servo::Servo;
use crate::drd::session::{ConnectionError, Description};
use crate::placement::Placement;

/// Which device to open, and its place in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct ForceDimensionConfig {
    /// The SDK's library; `None` tries its usual names.
    pub library: Option<PathBuf>,
    /// The device's number, from 0, in the order in which the system lists them.
    pub number: u8,
    /// Place of the device in the world.
    pub placement: Placement,
    /// Rate of the servo thread, Hz.
    pub servo_hz: u32,
}

/// Why a device could not be opened; the text says what to do.
pub type OpenError = open::OpenError<ConnectionError>;

/// A Force Dimension device; see the module [`drd`](crate::drd). Dropping it leaves zero force and a stopped device.
pub type ForceDimension = Served<Description>;

impl ForceDimension {
    /// Loads the SDK and finds the device. `arm` runs once in each servo thread, before its first tick; `report` receives
    /// messages for the operator, from a thread of normal priority.
    ///
    /// A device that is not calibrated is opened: it reads [`crate::DeviceFault::NotCalibrated`] until the operator has done it.
    pub fn open(config: ForceDimensionConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        let api = Api::load(config.library.as_deref())?;
        Self::open_with(api, config, arm, report)
    }

    /// As [`open`](Self::open), with a library that is already loaded.
    pub fn open_with(api: Api, config: ForceDimensionConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        Self::start("force-dimension", report, |shared, end| {
            let servo = Servo::new(api, config.placement, arm, end, config.servo_hz);
            Connector::new(api, config.number, shared, servo)
        })
    }
}
