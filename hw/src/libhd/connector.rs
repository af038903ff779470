//! The thread of normal priority that connects a device, calibrates it, watches it, and reconnects it after a loss.

use core::time::Duration;
use std::sync::PoisonError;
use std::thread;
use std::time::Instant;

use crate::device::{DeviceFault, DeviceInfo};
use crate::driver_thread::keeper::{self, Connect};
use crate::driver_thread::serving;
use crate::libhd::calibrate::{self, Calibration};
use crate::libhd::device::PhantomConfig;
use crate::libhd::exchange::Served;
use crate::libhd::ffi::Api;
use crate::libhd::servo::Servo;
use crate::libhd::session::{ConnectionError, Description, Session};

/// Silence after which a servo loop is stopped and restarted.
const SILENT_FOR: Duration = Duration::from_millis(250);
const CALIBRATION_EVERY: Duration = Duration::from_millis(50);
const FIRST_CALL_LIMIT: Duration = Duration::from_secs(2);
/// Longest wait for the callback to write zero before the scheduler stops.
const RELEASE_LIMIT: Duration = Duration::from_millis(50);

/// Owner of the connection; see the module.
pub struct Connector {
    api: Api,
    servo: &'static Servo,
    config: PhantomConfig,
    /// Limits that the force loop uses, fixed by the first connection.
    info: Option<DeviceInfo>,
}

type Keeper = keeper::Keeper<Connector>;

impl Connect for Connector {
    type Session = Session;
    type Description = Description;
    type Error = ConnectionError;

    fn open(&mut self) -> Result<Session, ConnectionError> {
        Session::open(&self.api, self.config.name.as_deref())
    }

    fn prepare(&mut self, keeper: &mut Keeper, session: &mut Session) -> Result<bool, ConnectionError> {
        let description = session.describe()?;
        match &self.info {
            Some(info) if *info != description.info => {
                return Err(ConnectionError::OtherModel {
                    was: info.name,
                    is: description.model,
                });
            }
            _ => self.info = Some(description.info),
        }
        if !self.calibrate(keeper, session, &description)? {
            return Ok(false);
        }
        let granted = self.start(session)?;
        keeper.report(&format!("{description}; servo thread: {granted}"));
        keeper.opened(description);
        Ok(true)
    }

    fn watch(&mut self, keeper: &mut Keeper, session: &Session) -> Option<String> {
        let loss = |code| ConnectionError::Call("the servo loop", code).to_string();
        let silence = "the driver's servo loop has stopped; restarting it";
        let shared = &self.servo.exchange.shared;
        keeper::watch(keeper, shared, SILENT_FOR, || session.is_scheduled(), loss, silence)
    }

    /// Writes zero force, if callbacks still arrive; then stops the scheduler and disables the device.
    fn release(&mut self, _keeper: &mut Keeper, session: Session) {
        let exchange = &self.servo.exchange;
        let before = exchange.released();
        exchange.shared.request_release();
        let start = Instant::now();
        while session.is_running() && start.elapsed() < RELEASE_LIMIT {
            // The first of them may have begun before the request.
            if exchange.released() > before + 1 {
                break;
            }
            thread::park_timeout(Duration::from_millis(1));
        }
        session.close();
        exchange.shared.released();
    }

    fn not_connected(&self) {
        self.servo.exchange.shared.not_connected();
    }
}

impl Connector {
    pub fn new(api: Api, servo: &'static Servo, config: PhantomConfig) -> Self {
        Self {
            api,
            servo,
            config,
            info: None,
        }
    }

    /// Waits until the device is calibrated; returns false when the thread must end.
    fn calibrate(
        &mut self,
        keeper: &mut Keeper,
        session: &Session,
        description: &Description,
    ) -> Result<bool, ConnectionError> {
        while !keeper.stopped() {
            match calibrate::step(&self.api, session.handle)? {
                Calibration::Done => return Ok(true),
                Calibration::Updated => {}
                Calibration::NeedsOperator(what_to_do) => {
                    self.servo.exchange.shared.fault.set(Some(DeviceFault::NotCalibrated));
                    keeper.report(what_to_do);
                    keeper.opened(description.clone());
                }
            }
            thread::park_timeout(CALIBRATION_EVERY);
        }
        Ok(false)
    }

    /// Starts the servo loop and waits for its first callback; returns the rights that its thread
    /// was granted.
    fn start(&self, session: &mut Session) -> Result<String, ConnectionError> {
        let armed = || self.servo.armed.lock().unwrap_or_else(PoisonError::into_inner).take();
        let _ = armed();
        let torques = self.info.is_some_and(|info| info.peak_torque_nm > 0.0);
        self.servo.exchange.serve(Served {
            handle: session.handle,
            torques,
        });
        let context = core::ptr::from_ref(self.servo).cast_mut().cast();
        // SAFETY: the servo is never freed, and admits one thread at a time.
        unsafe { session.start(Servo::callback, context, self.config.servo_hz) }?;
        let start = Instant::now();
        while start.elapsed() < FIRST_CALL_LIMIT {
            if let Some(granted) = armed() {
                let granted = granted.map_err(ConnectionError::NotArmed)?;
                serving::wait_for_sample(&self.servo.exchange.shared);
                return Ok(granted);
            }
            thread::park_timeout(Duration::from_millis(1));
        }
        Err(ConnectionError::NoCallback)
    }
}
