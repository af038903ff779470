//! The thread of normal priority that connects a device, calibrates it, watches it, and reconnects it after a loss.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::{Arc, PoisonError, mpsc};
use std::thread::{self, Thread};
use std::time::Instant;

use crate::device::{DeviceFault, DeviceInfo};
use crate::libhd::calibrate::{self, Calibration};
use crate::libhd::device::PhantomConfig;
use crate::libhd::exchange::Served;
use crate::libhd::ffi::Api;
use crate::libhd::servo::Servo;
use crate::libhd::session::{ConnectionError, Description, Session};

/// Takes a message for the operator.
pub type Report = Box<dyn Fn(&str) + Send>;

/// Between two checks of a running device.
const CHECK_EVERY: Duration = Duration::from_millis(20);
/// A servo loop that does not call for this long is stopped and restarted.
const SILENT_FOR: Duration = Duration::from_millis(250);
/// Between two attempts to connect.
const RETRY_EVERY: Duration = Duration::from_millis(500);
const CALIBRATION_EVERY: Duration = Duration::from_millis(50);
const FIRST_CALL_LIMIT: Duration = Duration::from_secs(2);
const FIRST_SAMPLE_LIMIT: Duration = Duration::from_millis(100);
/// Longest wait for the callback to write zero before the scheduler stops.
const RELEASE_LIMIT: Duration = Duration::from_millis(50);
/// Longest wait for the thread to end; a driver that hangs is abandoned.
const END_LIMIT: Duration = Duration::from_secs(3);

/// Owns the connection; see the module.
pub struct Connector {
    api: Api,
    servo: &'static Servo,
    config: PhantomConfig,
    report: Report,
    stop: Arc<AtomicBool>,
    /// The last message, so that a retry does not repeat it.
    last_message: String,
    /// The limits that the force loop uses, fixed by the first connection.
    info: Option<DeviceInfo>,
}

/// A running connector. Dropping it releases the device and waits until that is done.
pub struct ConnectorThread {
    stop: Arc<AtomicBool>,
    thread: Option<Thread>,
    ended: mpsc::Receiver<()>,
}

type First = Option<mpsc::Sender<Result<Description, ConnectionError>>>;

impl Connector {
    pub fn new(api: Api, servo: &'static Servo, config: PhantomConfig, report: Report) -> Self {
        Self {
            api,
            servo,
            config,
            report,
            stop: Arc::default(),
            last_message: String::new(),
            info: None,
        }
    }

    /// Starts the thread. `first` receives the result of the first attempt; when it fails, the thread ends.
    pub fn spawn(self, first: mpsc::Sender<Result<Description, ConnectionError>>) -> ConnectorThread {
        let stop = Arc::clone(&self.stop);
        let (end, ended) = mpsc::channel();
        let spawned = thread::Builder::new()
            .name("phantom".to_owned())
            .stack_size(512 * 1024)
            .spawn(move || {
                self.run(Some(first));
                // The receiver may have given up.
                let _ = end.send(());
            });
        let thread = spawned.ok().map(|handle| handle.thread().clone());
        ConnectorThread { stop, thread, ended }
    }

    fn run(mut self, mut first: First) {
        while !self.stopped() {
            let api = self.api;
            let lost = match self.connect(&api, &mut first) {
                Ok(Some(session)) => {
                    let lost = self.watch(&session);
                    self.release(session);
                    lost
                }
                Ok(None) => None,
                Err(error) => {
                    self.servo.shared.set_fault(Some(DeviceFault::NotConnected));
                    if let Some(first) = first.take() {
                        let _ = first.send(Err(error));
                        return;
                    }
                    Some(error.to_string())
                }
            };
            if let Some(why) = lost {
                self.report(&why);
                thread::park_timeout(RETRY_EVERY);
            }
        }
    }

    fn stopped(&self) -> bool {
        // SYNC: relaxed; the flag carries nothing with it. Its partner is the store in `drop`.
        self.stop.load(Ordering::Relaxed)
    }

    fn report(&mut self, message: &str) {
        if self.last_message != message {
            (self.report)(message);
            message.clone_into(&mut self.last_message);
        }
    }

    /// `None` when the thread is to end.
    fn connect<'a>(&mut self, api: &'a Api, first: &mut First) -> Result<Option<Session<'a>>, ConnectionError> {
        let mut session = Session::open(api, self.config.name.as_deref())?;
        match self.prepare(&mut session, first) {
            Ok(true) => Ok(Some(session)),
            Ok(false) => {
                self.release(session);
                Ok(None)
            }
            Err(error) => {
                self.release(session);
                Err(error)
            }
        }
    }

    fn prepare(&mut self, session: &mut Session, first: &mut First) -> Result<bool, ConnectionError> {
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
        if !self.calibrate(session, &description, first)? {
            return Ok(false);
        }
        let granted = self.start(session)?;
        self.report(&format!("{description}; servo thread: {granted}"));
        if let Some(first) = first.take() {
            let _ = first.send(Ok(description));
        }
        Ok(true)
    }

    /// Waits until the device is calibrated; false when the thread is to end.
    fn calibrate(
        &mut self,
        session: &Session,
        description: &Description,
        first: &mut First,
    ) -> Result<bool, ConnectionError> {
        while !self.stopped() {
            match calibrate::step(&self.api, session.handle)? {
                Calibration::Done => return Ok(true),
                Calibration::Updated => {}
                Calibration::NeedsOperator(what_to_do) => {
                    self.servo.shared.set_fault(Some(DeviceFault::NotCalibrated));
                    self.report(what_to_do);
                    if let Some(first) = first.take() {
                        let _ = first.send(Ok(description.clone()));
                    }
                }
            }
            thread::park_timeout(CALIBRATION_EVERY);
        }
        Ok(false)
    }

    /// Starts the servo loop and waits for its first callback; returns what its thread was granted.
    fn start(&self, session: &mut Session) -> Result<String, ConnectionError> {
        let shared = &self.servo.shared;
        let armed = || self.servo.armed.lock().unwrap_or_else(PoisonError::into_inner).take();
        let _ = armed();
        let torques = self.info.is_some_and(|info| info.peak_torque_nm > 0.0);
        shared.serve(Served {
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
                self.wait_for_sample();
                return Ok(granted);
            }
            thread::park_timeout(Duration::from_millis(1));
        }
        Err(ConnectionError::NoCallback)
    }

    /// The first callback has begun: waits for its sample, so that whoever opened the device finds one, unless there is a fault.
    fn wait_for_sample(&self) {
        let start = Instant::now();
        while self.servo.shared.fault().is_some() && start.elapsed() < FIRST_SAMPLE_LIMIT {
            thread::park_timeout(Duration::from_millis(1));
        }
    }

    /// Returns when the device is lost, with the reason, or when the thread is to end.
    fn watch(&self, session: &Session) -> Option<String> {
        let shared = &self.servo.shared;
        let (mut calls, mut since) = (0, Instant::now());
        while !self.stopped() {
            let now = shared.calls();
            if now != calls {
                (calls, since) = (now, Instant::now());
            }
            if let Some(code) = shared.lost() {
                return Some(format!(
                    "the device is lost: {}",
                    ConnectionError::Call("the servo loop", code)
                ));
            }
            if since.elapsed() > SILENT_FOR || !session.is_scheduled() {
                shared.set_lost();
                shared.set_fault(Some(DeviceFault::TimedOut));
                return Some("the driver's servo loop has stopped; restarting it".to_owned());
            }
            thread::park_timeout(CHECK_EVERY);
        }
        None
    }

    /// Writes zero force, if callbacks still arrive; then stops the scheduler and disables the device.
    fn release(&self, session: Session) {
        let shared = &self.servo.shared;
        let before = shared.released();
        shared.request_release();
        let start = Instant::now();
        while session.is_running() && start.elapsed() < RELEASE_LIMIT {
            // The first of them may have begun before the request.
            if shared.released() > before + 1 {
                break;
            }
            thread::park_timeout(Duration::from_millis(1));
        }
        session.close();
        if shared.fault().is_none() {
            shared.set_fault(Some(DeviceFault::NotConnected));
        }
    }
}

impl Drop for ConnectorThread {
    fn drop(&mut self) {
        // SYNC: relaxed; its partner is the load in `stopped`, and `unpark` orders the two.
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = &self.thread {
            thread.unpark();
            let _ = self.ended.recv_timeout(END_LIMIT);
        }
    }
}
