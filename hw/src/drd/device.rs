//! A Force Dimension device as a [`Device`]: wait-free ends for the force loop.

use std::path::PathBuf;
use std::sync::Arc;

use crate::beside::arm::Arm;
use crate::beside::ends::{self, ForceLoopEnd};
use crate::beside::keeper::{self, KeeperThread, Report};
use crate::beside::open;
use crate::beside::shared::Shared;
use crate::device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
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

/// State of the driver beside the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings {
    /// Servo ticks so far.
    pub ticks: u64,
    /// Present fault.
    pub fault: Option<DeviceFault>,
    /// The SDK's last error by number, 0 for none.
    pub error: u32,
    /// Number of errors so far.
    pub errors: u64,
    /// Ticks in which the motors could not give all of the force.
    pub saturated: u64,
}

/// A Force Dimension device; see the module [`drd`](crate::drd). Dropping it leaves zero force and a stopped device.
pub struct ForceDimension {
    description: Description,
    shared: Arc<Shared>,
    end: ForceLoopEnd,
    _keeper: KeeperThread,
}

impl ForceDimension {
    /// Loads the SDK and finds the device. `arm` runs once in each servo thread, before its first tick; `report` receives
    /// messages for the operator, from a thread of normal priority.
    ///
    /// A device that is not calibrated is opened: it reads [`DeviceFault::NotCalibrated`] until the operator has done it.
    pub fn open(config: ForceDimensionConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        let api = Api::load(config.library.as_deref())?;
        Self::open_with(api, config, arm, report)
    }

    /// As [`open`](Self::open), with a library that is already loaded.
    pub fn open_with(api: Api, config: ForceDimensionConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        let (end, servo_end) = ends::pair();
        let shared = Arc::<Shared>::default();
        let servo = Servo::new(api, config.placement, arm, servo_end, config.servo_hz);
        let connector = Connector::new(api, config.number, Arc::clone(&shared), servo);
        let (keeper, opened) = keeper::spawn("force-dimension", connector, report);
        let description = open::first(&opened)?;
        Ok(Self {
            description,
            shared,
            end,
            _keeper: keeper,
        })
    }

    /// Properties of the device at the first connection.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// State of the driver beside the pose.
    pub fn readings(&self) -> Readings {
        readings(&self.shared)
    }
}

pub fn readings(shared: &Shared) -> Readings {
    Readings {
        ticks: shared.ticks(),
        fault: shared.fault.get(),
        error: shared.errors.last(),
        errors: shared.errors.count(),
        saturated: shared.saturated(),
    }
}

impl Device for ForceDimension {
    fn info(&self) -> DeviceInfo {
        self.description.info
    }

    fn read(&mut self, _dt_s: f64) -> Result<Sample, DeviceFault> {
        self.end.read(self.shared.fault.get())
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        self.end.write(&self.description.info, wrench)
    }
}
