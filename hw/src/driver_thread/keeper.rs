//! The thread of normal priority that connects a device, watches it, and connects it again after a loss.

use core::fmt::Display;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::{Arc, mpsc};
use std::thread::{self, Thread};
use std::time::Instant;

use crate::device::DeviceFault;
use crate::driver_thread::shared::Shared;

/// Receiver of messages for the operator.
pub type Report = Box<dyn Fn(&str) + Send>;

/// Time between two checks of a running device.
const CHECK_EVERY: Duration = Duration::from_millis(20);
/// Time between two attempts to connect.
const RETRY_EVERY: Duration = Duration::from_millis(500);
/// Longest wait for the thread to end; a driver that hangs is abandoned.
const END_LIMIT: Duration = Duration::from_secs(3);

/// Work of the keeper for one kind of device. Each call may block.
pub trait Connect: Sized + Send + 'static {
    /// One connection, from opening to closing.
    type Session;
    /// Properties of a connected device.
    type Description: Send + 'static;
    /// Reason why there is no connection.
    type Error: Display + Send + 'static;

    /// Opens a connection.
    fn open(&mut self) -> Result<Self::Session, Self::Error>;
    /// Starts serving and calls [`Keeper::opened`]; returns false when the thread must end.
    fn prepare(&mut self, keeper: &mut Keeper<Self>, session: &mut Self::Session) -> Result<bool, Self::Error>;
    /// Waits until the device is lost, and returns the reason; also returns when the thread must
    /// end.
    fn watch(&mut self, keeper: &mut Keeper<Self>, session: &Self::Session) -> Option<String>;
    /// Leaves zero force and closes the connection.
    fn release(&mut self, keeper: &mut Keeper<Self>, session: Self::Session);
    /// Publishes that no device is connected.
    fn not_connected(&self);
}

/// Sender of the first result: a description, or the reason why there is no connection.
type First<C> = mpsc::Sender<Result<<C as Connect>::Description, <C as Connect>::Error>>;

/// Receiver of the first result.
pub type Opened<C> = mpsc::Receiver<Result<<C as Connect>::Description, <C as Connect>::Error>>;

/// State common to all keepers.
pub struct Keeper<C: Connect> {
    stop: Arc<AtomicBool>,
    report: Report,
    /// The last message, so that a retry does not repeat it.
    last_message: String,
    first: Option<First<C>>,
}

/// A running keeper. Dropping it releases the device and waits until that is done.
pub struct KeeperThread {
    stop: Arc<AtomicBool>,
    thread: Option<Thread>,
    ended: mpsc::Receiver<()>,
}

/// Starts the thread. The receiver gets the result of the first attempt; when it fails, the thread ends.
pub fn spawn<C: Connect>(name: &str, connect: C, report: Report) -> (KeeperThread, Opened<C>) {
    let stop = Arc::<AtomicBool>::default();
    let (first, opened) = mpsc::channel();
    let (end, ended) = mpsc::channel();
    let keeper: Keeper<C> = Keeper {
        stop: Arc::clone(&stop),
        report,
        last_message: String::new(),
        first: Some(first),
    };
    let spawned = thread::Builder::new()
        .name(name.to_owned())
        .stack_size(512 * 1024)
        .spawn(move || {
            keeper.run(connect);
            // The receiver may have given up.
            let _ = end.send(());
        });
    let thread = spawned.ok().map(|handle| handle.thread().clone());
    (KeeperThread { stop, thread, ended }, opened)
}

impl<C: Connect> Keeper<C> {
    fn run(mut self, mut connect: C) {
        while !self.stopped() {
            let lost = match self.connect(&mut connect) {
                Ok(Some(session)) => {
                    let lost = connect.watch(&mut self, &session);
                    connect.release(&mut self, session);
                    lost
                }
                Ok(None) => None,
                Err(error) => {
                    connect.not_connected();
                    if let Some(first) = self.first.take() {
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

    /// Connects; returns `None` when the thread must end.
    fn connect(&mut self, connect: &mut C) -> Result<Option<C::Session>, C::Error> {
        let mut session = connect.open()?;
        let prepared = connect.prepare(self, &mut session);
        if let Ok(true) = prepared {
            return Ok(Some(session));
        }
        connect.release(self, session);
        prepared.map(|_| None)
    }

    /// Returns whether the thread must end.
    pub fn stopped(&self) -> bool {
        // SYNC: relaxed; the flag carries nothing with it. Its partner is the store in `drop`.
        self.stop.load(Ordering::Relaxed)
    }

    /// Reports a message unless it repeats the last one.
    pub fn report(&mut self, message: &str) {
        if self.last_message != message {
            (self.report)(message);
            message.clone_into(&mut self.last_message);
        }
    }

    /// Announces that the device is usable or waits for the operator, and releases the caller that
    /// opened it.
    pub fn opened(&mut self, description: C::Description) {
        if let Some(first) = self.first.take() {
            let _ = first.send(Ok(description));
        }
    }
}

/// Waits until the servo loop reports a loss, makes no tick for `silent_for`, or no longer `runs`; returns the reason.
/// Returns `None` when the thread must end.
pub fn watch<C: Connect>(
    keeper: &Keeper<C>,
    shared: &Shared,
    silent_for: Duration,
    runs: impl Fn() -> bool,
    loss: impl Fn(u32) -> String,
    silence: &str,
) -> Option<String> {
    let (mut ticks, mut since) = (0, Instant::now());
    while !keeper.stopped() {
        let now = shared.ticks();
        if now != ticks {
            (ticks, since) = (now, Instant::now());
        }
        if let Some(code) = shared.errors.lost() {
            return Some(format!("the device is lost: {}", loss(code)));
        }
        if since.elapsed() > silent_for || !runs() {
            shared.errors.set_lost();
            shared.fault.set(Some(DeviceFault::TimedOut));
            return Some(silence.to_owned());
        }
        thread::park_timeout(CHECK_EVERY);
    }
    None
}

impl Drop for KeeperThread {
    fn drop(&mut self) {
        // SYNC: relaxed; its partner is the load in `stopped`, and `unpark` orders the two.
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = &self.thread {
            thread.unpark();
            let _ = self.ended.recv_timeout(END_LIMIT);
        }
    }
}
