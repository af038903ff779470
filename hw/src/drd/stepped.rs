//! A Force Dimension device on the caller's thread and without a clock: each reading is a tick of the servo loop.
//!
//! For tests and measurements of what the back end does after a fault, which then does not depend on the machine. The ticks,
//! the connection and its errors are those of the device with threads.

use std::sync::Arc;

use crate::beside::ends::{self, ForceLoopEnd};
use crate::beside::shared::Shared;
use crate::device::{Device, DeviceFault, DeviceInfo, Sample, Wrench};
use crate::drd::connector::same_model;
use crate::drd::device::{ForceDimensionConfig, OpenError, Readings, readings};
use crate::drd::ffi::Api;
use crate::drd::servo::Servo;
use crate::drd::session::{ConnectionError, Description, Session};
use crate::drd::status::{Health, health};

/// Ticks between two attempts to connect.
const TICKS_BETWEEN_ATTEMPTS: u32 = 500;

/// See the module.
pub struct Stepped {
    api: Api,
    number: u8,
    description: Description,
    info: Option<DeviceInfo>,
    servo: Servo,
    shared: Arc<Shared>,
    end: ForceLoopEnd,
    session: Option<Session>,
    unconnected: u32,
    runs: Box<dyn FnMut() -> bool + Send>,
}

impl Stepped {
    /// Opens the device. `runs` says before each tick whether the servo thread would run in it, or wait in a call of the SDK.
    pub fn open(
        api: Api,
        config: &ForceDimensionConfig,
        runs: Box<dyn FnMut() -> bool + Send>,
    ) -> Result<Self, OpenError> {
        let (end, servo_end) = ends::pair();
        let arm = Box::new(|| Ok(String::new()));
        let mut servo = Servo::new(api, config.placement, arm, servo_end, config.servo_hz);
        let shared = Arc::<Shared>::default();
        let mut info = None;
        let (session, description) =
            connected(&api, config.number, &mut info, &mut servo, &shared).map_err(OpenError::Connection)?;
        Ok(Self {
            api,
            number: config.number,
            description,
            info,
            servo,
            shared,
            end,
            session: Some(session),
            unconnected: 0,
            runs,
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

    fn tick(&mut self) {
        if self.session.is_some() && self.shared.errors.is_lost() {
            self.close();
        }
        if self.session.is_some() {
            self.servo.tick(&self.shared);
            return;
        }
        self.unconnected += 1;
        if self.unconnected.is_multiple_of(TICKS_BETWEEN_ATTEMPTS) {
            let (api, number) = (self.api, self.number);
            let session = connected(&api, number, &mut self.info, &mut self.servo, &self.shared);
            self.session = session.ok().map(|(session, _)| session);
        }
    }

    fn close(&mut self) {
        if let Some(session) = self.session.take() {
            session.close();
            self.unconnected = 0;
        }
    }
}

/// Opens, describes and guards the device, and turns its forces on.
fn connected(
    api: &Api,
    number: u8,
    info: &mut Option<DeviceInfo>,
    servo: &mut Servo,
    shared: &Shared,
) -> Result<(Session, Description), ConnectionError> {
    let session = Session::open(api, number)?;
    let mut prepare = || {
        let mut description = session.describe()?;
        same_model(info, &description)?;
        match health(&session.status()?, false) {
            Health::Lost(_) => return Err(ConnectionError::Call("dhdGetStatus", 2)),
            Health::Pause(_) => return Err(ConnectionError::Call("dhdGetStatus", 12)),
            Health::Good | Health::Off { .. } => {}
        }
        description.watchdog_s = session.guard(&description.info);
        session.turn_on()?;
        Ok(description)
    };
    match prepare() {
        Ok(description) => {
            servo.begin(session.id, description.info.peak_torque_nm > 0.0);
            shared.serve();
            Ok((session, description))
        }
        Err(error) => {
            session.close();
            Err(error)
        }
    }
}

impl Device for Stepped {
    fn info(&self) -> DeviceInfo {
        self.description.info
    }

    fn read(&mut self, _dt_s: f64) -> Result<Sample, DeviceFault> {
        if (self.runs)() {
            self.tick();
        }
        self.end.read(self.shared.fault.get())
    }

    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceFault> {
        self.end.write(&self.description.info, wrench)
    }
}

impl Drop for Stepped {
    fn drop(&mut self) {
        self.close();
    }
}
