//! Connects a Force Dimension device, starts its servo thread, watches it, and reconnects it after a loss.

use core::time::Duration;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Instant;

use crate::device::DeviceInfo;
use crate::drd::ffi::Api;
use crate::drd::servo::Servo;
use crate::drd::session::{ConnectionError, Description, Session};
use crate::drd::status::{Health, health};
use crate::driver_thread::keeper::{self, Connect};
use crate::driver_thread::serving;
use crate::driver_thread::shared::Shared;

/// Silence after which a servo loop counts as waiting in a call of the SDK.
const SILENT_FOR: Duration = Duration::from_millis(250);
const CALIBRATION_EVERY: Duration = Duration::from_millis(50);
/// Time after which a servo thread that has not ended counts as waiting in a call of the SDK.
const RELEASE_LIMIT: Duration = Duration::from_millis(50);

/// Remark on a device whose driver may hang, without a watchdog.
const WITHOUT_WATCHDOG: &str =
    "the device has no watchdog that this SDK can arm: a driver that hangs leaves its last force";
const HANGS: &str = "the driver does not return from a call: the watchdog of the device drops the force";
const NEEDS_CALIBRATION: &str = "the device is not calibrated: calibrate it as its manual says; rt-core waits";

/// Owner of the connection; see the module.
pub struct Connector {
    api: Api,
    number: u8,
    shared: Arc<Shared>,
    /// Servo state; `None` while the servo thread owns it.
    servo: Option<Servo>,
    /// Limits that the force loop uses, fixed by the first connection.
    info: Option<DeviceInfo>,
}

/// An open device and the thread that serves it.
pub struct Running {
    session: Session,
    servo: Option<JoinHandle<Servo>>,
}

type Keeper = keeper::Keeper<Connector>;

impl Connect for Connector {
    type Session = Running;
    type Description = Description;
    type Error = ConnectionError;

    fn open(&mut self) -> Result<Running, ConnectionError> {
        if self.servo.is_none() {
            return Err(ConnectionError::NoServo);
        }
        let session = Session::open(&self.api, self.number)?;
        Ok(Running { session, servo: None })
    }

    fn prepare(&mut self, keeper: &mut Keeper, running: &mut Running) -> Result<bool, ConnectionError> {
        let mut description = running.session.describe()?;
        same_model(&mut self.info, &description)?;
        if !self.calibrate(keeper, &running.session, &description)? {
            return Ok(false);
        }
        description.watchdog_s = running.session.guard(&description.info);
        running.session.turn_on()?;
        let granted = self.start(running, &description.info)?;
        let watchdog = match description.watchdog_s {
            Some(s) => format!("the device drops a force that is not renewed for {:.0} ms", s * 1e3),
            None => WITHOUT_WATCHDOG.to_owned(),
        };
        keeper.report(&format!("{description}; {watchdog}; servo thread: {granted}"));
        keeper.opened(description);
        Ok(true)
    }

    fn watch(&mut self, keeper: &mut Keeper, running: &Running) -> Option<String> {
        let runs = || running.servo.as_ref().is_some_and(|servo| !servo.is_finished());
        let loss = |code| match code {
            0 => "by its own status".to_owned(),
            code => ConnectionError::Call("the servo loop", code).to_string(),
        };
        keeper::watch(keeper, &self.shared, SILENT_FOR, runs, loss, HANGS)
    }

    /// Ends the servo thread, which leaves zero force, and closes the device. If the servo thread
    /// hangs in a call, no other call is made and the device stays open.
    fn release(&mut self, keeper: &mut Keeper, running: Running) {
        self.shared.request_release();
        if let Some(servo) = running.servo {
            let begun = Instant::now();
            while !servo.is_finished() {
                if keeper.stopped() && begun.elapsed() > SILENT_FOR {
                    return;
                }
                if begun.elapsed() > RELEASE_LIMIT {
                    keeper.report(HANGS);
                }
                thread::park_timeout(Duration::from_millis(1));
            }
            self.servo = servo.join().ok();
        }
        running.session.close();
        self.shared.released();
    }

    fn not_connected(&self) {
        self.shared.not_connected();
    }
}

impl Connector {
    pub fn new(api: Api, number: u8, shared: Arc<Shared>, servo: Servo) -> Self {
        Self {
            api,
            number,
            shared,
            servo: Some(servo),
            info: None,
        }
    }

    /// Waits until the device is calibrated; returns false when the thread must end.
    fn calibrate(
        &self,
        keeper: &mut Keeper,
        session: &Session,
        description: &Description,
    ) -> Result<bool, ConnectionError> {
        while !keeper.stopped() {
            match health(&session.status()?, false) {
                Health::Lost(_) => return Err(ConnectionError::Call("dhdGetStatus", 2)),
                Health::Pause(fault) => {
                    self.shared.fault.set(Some(fault));
                    keeper.report(NEEDS_CALIBRATION);
                    keeper.opened(description.clone());
                }
                Health::Good | Health::Off { .. } => return Ok(true),
            }
            thread::park_timeout(CALIBRATION_EVERY);
        }
        Ok(false)
    }

    /// Starts the servo thread and waits for its first sample; returns the rights that it was
    /// granted.
    fn start(&mut self, running: &mut Running, info: &DeviceInfo) -> Result<String, ConnectionError> {
        let mut servo = self.servo.take().ok_or(ConnectionError::NoServo)?;
        servo.begin(running.session.id, info.peak_torque_nm > 0.0);
        let started = serving::start("dhd-servo", servo, &self.shared).ok_or(ConnectionError::NoServo)?;
        running.servo = Some(started.thread);
        let granted = started.granted.ok_or(ConnectionError::NoServo)?;
        granted.map_err(ConnectionError::NotArmed)
    }
}

/// Keeps the limits of the first connection, and refuses another model.
pub fn same_model(first: &mut Option<DeviceInfo>, now: &Description) -> Result<(), ConnectionError> {
    match first {
        Some(info) if *info != now.info => Err(ConnectionError::OtherModel {
            was: info.name,
            is: now.info.name,
        }),
        _ => {
            *first = Some(now.info);
            Ok(())
        }
    }
}
