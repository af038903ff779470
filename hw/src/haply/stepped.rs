//! An Inverse3 without threads; see [`stepped`](crate::driver_thread::stepped).

use std::time::Instant;

use crate::driver_thread::shared::Shared;
use crate::driver_thread::stepped::{self, Step};
use crate::haply::servo::Servo;
use crate::haply::session::{self, ConnectionError, Description, Wanted};
use crate::haply::wire::Wire;
use crate::placement::Placement;

/// An Inverse3 on the caller's thread and without a clock.
pub type Stepped = stepped::Stepped<Steps>;

/// Opener of a connection to a service, with its version; `None` if none answers.
pub type Opener = Box<dyn FnMut() -> Option<(Box<dyn Wire>, Option<String>)> + Send>;

/// Servo loop and connection of a stepped device.
pub struct Steps {
    opener: Opener,
    known: Option<Description>,
    servo: Servo,
}

impl Stepped {
    /// Opens the first device of the service.
    pub fn open(opener: Opener, placement: Placement, servo_hz: u32) -> Result<Self, ConnectionError> {
        Self::over(|end, shared| {
            let mut steps = Steps {
                opener,
                known: None,
                servo: Servo::new(placement, Box::new(|| Ok(String::new())), end, servo_hz),
            };
            let description = steps.open(shared)?;
            let info = description.info;
            steps.known = Some(description);
            Ok((steps, info))
        })
    }
}

impl Steps {
    fn open(&mut self, shared: &Shared) -> Result<Description, ConnectionError> {
        let (mut wire, version) = (self.opener)().ok_or_else(|| ConnectionError::NoService {
            address: "a test".to_owned(),
            why: "none".to_owned(),
        })?;
        let opened = session::open(&mut *wire, &Wanted::First, self.known.as_ref(), version);
        match &opened {
            Ok(description) => {
                self.servo.begin(wire, description);
                shared.serve();
            }
            Err(_) => wire.close(),
        }
        opened
    }
}

impl Step for Steps {
    fn connect(&mut self, shared: &Shared) -> bool {
        self.open(shared).is_ok()
    }

    fn close(&mut self) {
        self.servo.end_connection();
    }

    fn tick(&mut self, shared: &Shared) {
        self.servo.tick(shared, Instant::now());
    }
}
