//! A Force Dimension device without threads; see [`stepped`](crate::driver_thread::stepped).

use crate::device::DeviceInfo;
use crate::drd::connector::same_model;
use crate::drd::device::{ForceDimensionConfig, OpenError};
use crate::drd::ffi::Api;
use crate::drd::servo::Servo;
use crate::drd::session::{ConnectionError, Description, Session};
use crate::drd::status::{Health, health};
use crate::driver_thread::shared::Shared;
use crate::driver_thread::stepped::{self, Step};

/// A Force Dimension device on the caller's thread and without a clock.
pub type Stepped = stepped::Stepped<Steps>;

/// Servo loop and connection of a stepped device.
pub struct Steps {
    api: Api,
    number: u8,
    info: Option<DeviceInfo>,
    servo: Servo,
    session: Option<Session>,
    runs: Box<dyn FnMut() -> bool + Send>,
}

impl Stepped {
    /// Opens the device. Before each tick, `runs` says whether the servo thread would run in it,
    /// instead of waiting in a call of the SDK.
    pub fn open(
        api: Api,
        config: &ForceDimensionConfig,
        runs: Box<dyn FnMut() -> bool + Send>,
    ) -> Result<Self, OpenError> {
        Self::over(|end, shared| {
            let arm = Box::new(|| Ok(String::new()));
            let mut steps = Steps {
                api,
                number: config.number,
                info: None,
                servo: Servo::new(api, config.placement, arm, end, config.servo_hz),
                session: None,
                runs,
            };
            let description = steps.open(shared).map_err(OpenError::Connection)?;
            Ok((steps, description.info))
        })
    }
}

impl Steps {
    /// Opens, describes and guards the device, and turns its forces on.
    fn open(&mut self, shared: &Shared) -> Result<Description, ConnectionError> {
        let session = Session::open(&self.api, self.number)?;
        match self.prepare(&session) {
            Ok(description) => {
                self.servo.begin(session.id, description.info.peak_torque_nm > 0.0);
                shared.serve();
                self.session = Some(session);
                Ok(description)
            }
            Err(error) => {
                session.close();
                Err(error)
            }
        }
    }

    fn prepare(&mut self, session: &Session) -> Result<Description, ConnectionError> {
        let mut description = session.describe()?;
        same_model(&mut self.info, &description)?;
        match health(&session.status()?, false) {
            Health::Lost(_) => return Err(ConnectionError::Call("dhdGetStatus", 2)),
            Health::Pause(_) => return Err(ConnectionError::Call("dhdGetStatus", 12)),
            Health::Good | Health::Off { .. } => {}
        }
        description.watchdog_s = session.guard(&description.info);
        session.turn_on()?;
        Ok(description)
    }
}

impl Step for Steps {
    fn connect(&mut self, shared: &Shared) -> bool {
        self.open(shared).is_ok()
    }

    fn close(&mut self) {
        if let Some(session) = self.session.take() {
            session.close();
        }
    }

    fn tick(&mut self, shared: &Shared) {
        self.servo.tick(shared);
    }

    fn runs(&mut self) -> bool {
        (self.runs)()
    }
}
