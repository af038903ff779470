//! An Inverse3 on the caller's thread and without a clock: each reading is a tick of the servo loop.
//!
//! For tests and measurements of what the back end does after a fault, which then does not depend on the machine. The ticks,
//! the first messages and their errors are those of the device with threads.

use std::sync::Arc;
use std::time::Instant;

use crate::beside::ends::{self, ForceLoopEnd};
use crate::beside::shared::Shared;
use crate::device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use crate::haply::device::{Readings, readings};
use crate::haply::servo::Servo;
use crate::haply::session::{self, ConnectionError, Description, Wanted};
use crate::haply::wire::Wire;
use crate::placement::Placement;

/// Opens a connection to a service, with the service's version; `None` where none answers.
pub type Opener = Box<dyn FnMut() -> Option<(Box<dyn Wire>, Option<String>)> + Send>;

/// Ticks between two attempts to connect.
const TICKS_BETWEEN_ATTEMPTS: u32 = 500;

/// See the module.
pub struct Stepped {
    opener: Opener,
    description: Description,
    servo: Servo,
    shared: Arc<Shared>,
    end: ForceLoopEnd,
    connected: bool,
    unconnected: u32,
}

impl Stepped {
    /// Opens the first device of the service.
    pub fn open(mut opener: Opener, placement: Placement, servo_hz: u32) -> Result<Self, ConnectionError> {
        let (end, servo_end) = ends::pair();
        let mut servo = Servo::new(placement, Box::new(|| Ok(String::new())), servo_end, servo_hz);
        let shared = Arc::<Shared>::default();
        let description = connect(&mut opener, None, &mut servo, &shared)?;
        Ok(Self {
            opener,
            description,
            servo,
            shared,
            end,
            connected: true,
            unconnected: 0,
        })
    }

    /// State of the connection beside the pose.
    pub fn readings(&self) -> Readings {
        readings(&self.shared)
    }

    fn tick(&mut self) {
        if self.connected && self.shared.errors.is_lost() {
            self.servo.end_connection();
            (self.connected, self.unconnected) = (false, 0);
        }
        if self.connected {
            self.servo.tick(&self.shared, Instant::now());
            return;
        }
        self.unconnected += 1;
        if self.unconnected.is_multiple_of(TICKS_BETWEEN_ATTEMPTS) {
            let known = Some(&self.description);
            self.connected = connect(&mut self.opener, known, &mut self.servo, &self.shared).is_ok();
        }
    }
}

fn connect(
    opener: &mut Opener,
    known: Option<&Description>,
    servo: &mut Servo,
    shared: &Shared,
) -> Result<Description, ConnectionError> {
    let (mut wire, version) = opener().ok_or_else(|| ConnectionError::NoService {
        address: "a test".to_owned(),
        why: "none".to_owned(),
    })?;
    match session::open(&mut *wire, &Wanted::First, known, version) {
        Ok(description) => {
            servo.begin(wire, &description);
            shared.serve();
            Ok(description)
        }
        Err(error) => {
            wire.close();
            Err(error)
        }
    }
}

impl Device for Stepped {
    fn info(&self) -> DeviceInfo {
        self.description.info
    }

    fn read(&mut self, _dt_s: f64) -> Result<Sample, DeviceFault> {
        self.tick();
        self.end.read(self.shared.fault.get())
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        self.end.write(&self.description.info, wrench)
    }
}

impl Drop for Stepped {
    fn drop(&mut self) {
        self.servo.end_connection();
    }
}
