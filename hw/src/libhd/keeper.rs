//! The thread of normal priority that connects a device, calibrates it, watches it, and takes it up again after a loss.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::{Arc, PoisonError, mpsc};
use std::thread::{self, Thread};
use std::time::Instant;

use crate::device::{DeviceFault, DeviceInfo};
use crate::libhd::calibrate::{self, Calibration};
use crate::libhd::device::PhantomConfig;
use crate::libhd::ffi::Api;
use crate::libhd::servo::Servo;
use crate::libhd::session::{Description, Session, Trouble};

/// Takes a message for the operator.
pub type Tell = Box<dyn Fn(&str) + Send>;

/// Between two looks at a running device.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// A servo loop that does not call for so long is stopped and started anew.
const SILENT_FOR: Duration = Duration::from_millis(250);
/// Between two tries to connect.
const RETRY_EVERY: Duration = Duration::from_millis(500);
const CALIBRATION_EVERY: Duration = Duration::from_millis(50);
const FIRST_CALL_LIMIT: Duration = Duration::from_secs(2);
const FIRST_SAMPLE_LIMIT: Duration = Duration::from_millis(100);
/// For the callback to write its zero before the scheduler stops.
const RELEASE_LIMIT: Duration = Duration::from_millis(50);
/// A driver that hangs is left alone after this.
const END_LIMIT: Duration = Duration::from_secs(3);

pub struct Keeper {
    api: Api,
    servo: &'static Servo,
    config: PhantomConfig,
    tell: Tell,
    stop: Arc<AtomicBool>,
    /// Told last, so that a retry does not repeat it.
    told: String,
    /// The limits that the force loop was given.
    promised: Option<DeviceInfo>,
}

/// A running keeper; dropped, it lets the device go and waits until that is done.
pub struct KeeperThread {
    stop: Arc<AtomicBool>,
    thread: Option<Thread>,
    ended: mpsc::Receiver<()>,
}

type First = Option<mpsc::Sender<Result<Description, Trouble>>>;

impl Keeper {
    pub fn new(api: Api, servo: &'static Servo, config: PhantomConfig, tell: Tell) -> Self {
        Self {
            api,
            servo,
            config,
            tell,
            stop: Arc::default(),
            told: String::new(),
            promised: None,
        }
    }

    /// `first` hears whether there is a device; without one the thread ends.
    pub fn spawn(self, first: mpsc::Sender<Result<Description, Trouble>>) -> KeeperThread {
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
        KeeperThread { stop, thread, ended }
    }

    fn run(mut self, mut first: First) {
        while !self.stopped() {
            let api = self.api;
            let lost = match self.connect(&api, &mut first) {
                Ok(Some(session)) => {
                    let lost = self.watch(&session);
                    self.let_go(session);
                    lost
                }
                Ok(None) => None,
                Err(trouble) => {
                    self.servo.shared.set_fault(Some(DeviceFault::NotConnected));
                    if let Some(first) = first.take() {
                        let _ = first.send(Err(trouble));
                        return;
                    }
                    Some(trouble.to_string())
                }
            };
            if let Some(why) = lost {
                self.say(&why);
                thread::park_timeout(RETRY_EVERY);
            }
        }
    }

    fn stopped(&self) -> bool {
        // SYNC: nothing but the flag is carried.
        self.stop.load(Ordering::Relaxed)
    }

    fn say(&mut self, message: &str) {
        if self.told != message {
            (self.tell)(message);
            message.clone_into(&mut self.told);
        }
    }

    /// `None` when told to stop on the way.
    fn connect<'a>(&mut self, api: &'a Api, first: &mut First) -> Result<Option<Session<'a>>, Trouble> {
        let mut session = Session::open(api, self.config.name.as_deref())?;
        match self.prepare(&mut session, first) {
            Ok(true) => Ok(Some(session)),
            Ok(false) => {
                self.let_go(session);
                Ok(None)
            }
            Err(trouble) => {
                self.let_go(session);
                Err(trouble)
            }
        }
    }

    fn prepare(&mut self, session: &mut Session, first: &mut First) -> Result<bool, Trouble> {
        let description = session.describe()?;
        match &self.promised {
            Some(info) if *info != description.info => {
                return Err(Trouble::OtherModel {
                    was: info.name,
                    is: description.model,
                });
            }
            _ => self.promised = Some(description.info),
        }
        if !self.calibrate(session, &description, first)? {
            return Ok(false);
        }
        let granted = self.start(session)?;
        self.say(&format!("{description}; servo thread: {granted}"));
        if let Some(first) = first.take() {
            let _ = first.send(Ok(description));
        }
        Ok(true)
    }

    /// Until the device is calibrated; false when told to stop.
    fn calibrate(&mut self, session: &Session, description: &Description, first: &mut First) -> Result<bool, Trouble> {
        while !self.stopped() {
            match calibrate::step(&self.api, session.handle)? {
                Calibration::Done => return Ok(true),
                Calibration::Updated => {}
                Calibration::Waits(what_to_do) => {
                    self.servo.shared.set_fault(Some(DeviceFault::NotCalibrated));
                    self.say(what_to_do);
                    if let Some(first) = first.take() {
                        let _ = first.send(Ok(description.clone()));
                    }
                }
            }
            thread::park_timeout(CALIBRATION_EVERY);
        }
        Ok(false)
    }

    /// Starts the servo loop and waits for its first callback; says what its thread was granted.
    fn start(&self, session: &mut Session) -> Result<String, Trouble> {
        let shared = &self.servo.shared;
        let armed = || self.servo.armed.lock().unwrap_or_else(PoisonError::into_inner).take();
        let _ = armed();
        let torques = self.promised.is_some_and(|info| info.peak_torque_nm > 0.0);
        shared.torques.store(torques, Ordering::Relaxed);
        shared.handle.store(session.handle, Ordering::Relaxed);
        shared.lost.store(false, Ordering::Relaxed);
        shared.release.store(false, Ordering::Relaxed);
        shared.arm.store(true, Ordering::Relaxed);
        let context = core::ptr::from_ref(self.servo).cast_mut().cast();
        // SAFETY: the servo is never freed, and lets one thread in at a time.
        unsafe { session.start(Servo::callback, context, self.config.servo_hz) }?;
        let begun = Instant::now();
        while begun.elapsed() < FIRST_CALL_LIMIT {
            if let Some(granted) = armed() {
                let granted = granted.map_err(Trouble::NotArmed)?;
                self.wait_for_sample();
                return Ok(granted);
            }
            thread::park_timeout(Duration::from_millis(1));
        }
        Err(Trouble::NoCallback)
    }

    /// The first callback has begun; whoever opened the device finds a sample, unless something is wrong.
    fn wait_for_sample(&self) {
        let begun = Instant::now();
        while self.servo.shared.fault().is_some() && begun.elapsed() < FIRST_SAMPLE_LIMIT {
            thread::park_timeout(Duration::from_millis(1));
        }
    }

    /// Until the device is lost, with the reason, or the end is asked for.
    fn watch(&self, session: &Session) -> Option<String> {
        let shared = &self.servo.shared;
        let (mut calls, mut since) = (0, Instant::now());
        while !self.stopped() {
            let now = shared.calls.load(Ordering::Relaxed);
            if now != calls {
                (calls, since) = (now, Instant::now());
            }
            if shared.lost.load(Ordering::Relaxed) {
                let code = shared.error.load(Ordering::Relaxed);
                return Some(format!("the device is lost: {}", Trouble::Call("the servo loop", code)));
            }
            if since.elapsed() > SILENT_FOR || !session.is_scheduled() {
                shared.lost.store(true, Ordering::Relaxed);
                shared.set_fault(Some(DeviceFault::TimedOut));
                return Some("the driver's servo loop has stopped; it is started anew".to_owned());
            }
            thread::park_timeout(LOOK_EVERY);
        }
        None
    }

    /// Zero force first, as far as callbacks still come; then the scheduler and the device.
    fn let_go(&self, session: Session) {
        let shared = &self.servo.shared;
        let before = shared.released.load(Ordering::Relaxed);
        shared.release.store(true, Ordering::Relaxed);
        let begun = Instant::now();
        while session.is_running() && begun.elapsed() < RELEASE_LIMIT {
            if shared.released.load(Ordering::Relaxed) > before + 1 {
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

impl Drop for KeeperThread {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = &self.thread {
            thread.unpark();
            let _ = self.ended.recv_timeout(END_LIMIT);
        }
    }
}
