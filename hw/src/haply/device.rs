//! An Inverse3, opened.

use crate::driver_thread::arm::Arm;
use crate::driver_thread::keeper::Report;
use crate::driver_thread::open;
use crate::driver_thread::served::Served;
use crate::haply::connector::Connector;
use crate::haply::servo::Servo;
use crate::haply::session::{ConnectionError, Description, Wanted};
use crate::haply::socket::Service;
use crate::placement::Placement;

/// Device to open, and its place in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct HaplyConfig {
    /// The Inverse service.
    pub service: Service,
    /// Device to take from the service's list.
    pub wanted: Wanted,
    /// Place of the device in the world.
    pub placement: Placement,
    /// Rate of the servo thread, Hz.
    pub servo_hz: u32,
}

/// Reason why a device could not be opened; the text says what to do.
pub type OpenError = open::OpenError<ConnectionError>;

/// An Inverse3; see the module [`haply`](crate::haply). Dropping it leaves zero force and a closed connection.
pub type Haply = Served<Description>;

impl Haply {
    /// Connects to the service and finds the device. `arm` runs once in each servo thread, before
    /// its first tick. `report` receives messages for the operator, from a thread of normal
    /// priority.
    pub fn open(config: HaplyConfig, arm: Arm, report: Report) -> Result<Self, OpenError> {
        Self::start("haply", report, |shared, end| {
            let servo = Servo::new(config.placement, arm, end, config.servo_hz);
            Connector::new(config.service, config.wanted, shared, servo)
        })
    }
}
