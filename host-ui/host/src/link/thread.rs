//! The thread of a link and the host's side of it: it receives from a core, or plays a recording.

use super::inbox::{Inbox, Pulse};
use super::player::{Playback, Played, Player};
use super::receiver::{Outgoing, Passes};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::thread::JoinHandle;
use std::time::Duration;
use stylet_shm_schema::Instance;

const PASS: Duration = Duration::from_millis(2);
/// Most messages of the host queued for the sending thread.
const OUTGOING: usize = 64;

/// The host's side of the thread; dropping it ends the thread and closes the ports.
pub struct Receiver {
    inbox: Arc<Mutex<Inbox>>,
    outgoing: mpsc::SyncSender<Outgoing>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Receiver {
    pub fn start(instance: Instance, host_id: u64, snapshots_every: Duration) -> Self {
        let inbox = Arc::new(Mutex::new(Inbox::default()));
        let (outgoing, asked) = mpsc::sync_channel(OUTGOING);
        let into = Arc::clone(&inbox);
        // Made by the thread, as the ports are.
        let make = move || {
            let mut passes = Passes::new((instance, host_id), snapshots_every, into, asked);
            move || {
                passes.pass();
                PASS
            }
        };
        Self::with_thread("link", inbox, outgoing, make)
    }

    /// Plays a recording; requests are ignored.
    pub fn play(played: Arc<Played>, playback: Playback) -> Self {
        let inbox = Arc::new(Mutex::new(Inbox::default()));
        let (outgoing, _) = mpsc::sync_channel(OUTGOING);
        let mut player = Player::new(played, playback, Arc::clone(&inbox));
        Self::with_thread("player", inbox, outgoing, move || move || player.pass())
    }

    /// Starts a thread that calls the function made by `make` repeatedly, waiting in between for the returned time.
    fn with_thread<P: FnMut() -> Duration>(
        name: &str,
        inbox: Arc<Mutex<Inbox>>,
        outgoing: mpsc::SyncSender<Outgoing>,
        make: impl FnOnce() -> P + Send + 'static,
    ) -> Self {
        let end = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&end);
        let work = move || {
            let mut pass = make();
            // SYNC: set when the host drops its side; nothing but the flag is carried.
            while !ended.load(Ordering::Relaxed) {
                std::thread::park_timeout(pass());
            }
        };
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(work);
        if let Err(why) = &thread {
            lock(&inbox).pulse.trouble = Some(format!("no thread could be started to receive: {why}"));
        }
        Self {
            inbox,
            outgoing,
            end,
            thread: thread.ok(),
        }
    }

    /// Takes everything received since the last call.
    pub fn take(&self) -> Inbox {
        lock(&self.inbox).take()
    }

    /// Returns the present state of the connection, without taking data.
    pub fn pulse(&self) -> Pulse {
        lock(&self.inbox).pulse.clone()
    }

    /// Queues a message; false if the queue is full.
    pub fn send(&self, outgoing: Outgoing) -> bool {
        let accepted = self.outgoing.try_send(outgoing).is_ok();
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
        accepted
    }
}

impl Drop for Receiver {
    fn drop(&mut self) {
        // SYNC: read by the thread; nothing but the flag is carried.
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // A panic there was reported when it happened.
            let _ended = thread.join();
        }
    }
}

/// The data behind the lock is consistent after each statement.
pub(super) fn lock(inbox: &Mutex<Inbox>) -> MutexGuard<'_, Inbox> {
    inbox.lock().unwrap_or_else(PoisonError::into_inner)
}
