//! An Inverse3 as a [`Device`]: wait-free ends for the force loop.

use std::sync::Arc;

use crate::beside::arm::Arm;
use crate::beside::ends::{self, ForceLoopEnd};
use crate::beside::keeper::{self, KeeperThread, Report};
use crate::beside::open;
use crate::beside::shared::Shared;
use crate::device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use crate::haply::connector::Connector;
use crate::haply::servo::Servo;
use crate::haply::session::{ConnectionError, Description, Wanted};
use crate::haply::socket::Service;
use crate::placement::Placement;

/// Which device to open, and its place in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct HaplyConfig {
    /// The Inverse service.
    pub service: Service,
    /// Which of its devices.
    pub wanted: Wanted,
    /// Place of the device in the world.
    pub placement: Placement,
    /// Rate of the servo thread, Hz.
    pub servo_hz: u32,
}

/// Why a device could not be opened; the text says what to do.
pub type OpenError = open::OpenError<ConnectionError>;

/// State of the connection beside the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings {
    /// Servo ticks so far.
    pub ticks: u64,
    /// Present fault.
    pub fault: Option<DeviceFault>,
    /// Number of errors so far: states that are none, and lost connections.
    pub errors: u64,
}

/// An Inverse3; see the module [`haply`](crate::haply). Dropping it leaves zero force and a closed connection.
pub struct Haply {
    description: Description,
    shared: Arc<Shared>,
    end: ForceLoopEnd,
    _keeper: KeeperThread,
}

impl Haply {
    /// Connects to the service and finds the device. `arm` runs once in each servo thread, before its first tick; `report`
    /// receives messages for the operator, from a thread of normal priority.
    pub fn open(config: HaplyConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        let (end, servo_end) = ends::pair();
        let shared = Arc::<Shared>::default();
        let servo = Servo::new(config.placement, arm, servo_end, config.servo_hz);
        let connector = Connector::new(config.service, config.wanted, Arc::clone(&shared), servo);
        let (keeper, opened) = keeper::spawn("haply", connector, report);
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

    /// State of the connection beside the pose.
    pub fn readings(&self) -> Readings {
        readings(&self.shared)
    }
}

pub fn readings(shared: &Shared) -> Readings {
    Readings {
        ticks: shared.ticks(),
        fault: shared.fault.get(),
        errors: shared.errors.count(),
    }
}

impl Device for Haply {
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
