//! The receiving side of a link: it receives from a core, or plays a recording.

use super::here::{Here, LocalCore};
use super::inbox::{Inbox, Pulse};
use super::outgoing::Outgoing;
use super::player::{Playback, Played, Player};
#[cfg(not(target_family = "wasm"))]
use super::receiver::Passes;
use super::worker::Worker;
use std::fmt::Display;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use stylet_shm_schema::Instance;
use web_time::Duration;

#[cfg(not(target_family = "wasm"))]
const PASS: Duration = Duration::from_millis(2);
/// Time between two calls where there is no core.
const NO_CORE: Duration = Duration::from_secs(1);
/// Most messages of the host queued for the receiving side.
const OUTGOING: usize = 64;

/// The host's side of the receiver; dropping it ends its thread and closes the ports.
pub struct Receiver {
    inbox: Arc<Mutex<Inbox>>,
    outgoing: mpsc::SyncSender<Outgoing>,
    worker: Option<Worker>,
}

impl Receiver {
    /// Receives nothing: a web page has no shared memory.
    #[cfg(target_family = "wasm")]
    pub fn start(_instance: Instance, _host_id: u64, _snapshots_every: Duration) -> Self {
        let receiver = Self::of("link", |_, _| || NO_CORE);
        lock(&receiver.inbox).pulse.trouble = Some("a web page reaches no rt-core".to_owned());
        receiver
    }

    /// Receives through the shared memory of `instance`.
    #[cfg(not(target_family = "wasm"))]
    pub fn start(instance: Instance, host_id: u64, snapshots_every: Duration) -> Self {
        // Made by the thread, as the ports are.
        Self::of("link", move |inbox, asked| {
            let mut passes = Passes::new((instance, host_id), snapshots_every, inbox, asked);
            move || {
                passes.pass();
                PASS
            }
        })
    }

    /// Plays a recording; requests are ignored.
    pub fn play(played: Arc<Played>, playback: Playback) -> Self {
        Self::of("player", move |inbox, _| {
            let mut player = Player::new(played, playback, inbox);
            move || player.pass()
        })
    }

    /// Runs a core in this process, made where it runs.
    pub fn here<C: LocalCore, E: Display>(host_id: u64, make: impl FnOnce() -> Result<C, E> + Send + 'static) -> Self {
        Self::of("core", move |inbox, asked| {
            let made = make().map_err(|why| lock(&inbox).pulse.trouble = Some(why.to_string()));
            let mut here = made.ok().map(|core| Here::new(core, host_id, inbox, asked));
            move || here.as_mut().map_or(NO_CORE, Here::pass)
        })
    }

    /// Calls the function made by `make` repeatedly, waiting in between for the returned time.
    fn of<P: FnMut() -> Duration + 'static>(
        name: &str,
        make: impl FnOnce(Arc<Mutex<Inbox>>, mpsc::Receiver<Outgoing>) -> P + Send + 'static,
    ) -> Self {
        let inbox = Arc::new(Mutex::new(Inbox::default()));
        let (outgoing, asked) = mpsc::sync_channel(OUTGOING);
        let into = Arc::clone(&inbox);
        let worker = Worker::start(name, move || make(into, asked));
        if let Err(why) = &worker {
            lock(&inbox).pulse.trouble = Some(format!("no thread could be started to receive: {why}"));
        }
        Self {
            inbox,
            outgoing,
            worker: worker.ok(),
        }
    }

    /// Takes everything received since the last call.
    pub fn take(&self) -> Inbox {
        self.worker.iter().for_each(Worker::turn);
        lock(&self.inbox).take()
    }

    /// Returns the present state of the connection, without taking data.
    pub fn pulse(&self) -> Pulse {
        lock(&self.inbox).pulse.clone()
    }

    /// Queues a message; false if the queue is full.
    pub fn send(&self, outgoing: Outgoing) -> bool {
        let accepted = self.outgoing.try_send(outgoing).is_ok();
        self.worker.iter().for_each(Worker::wake);
        accepted
    }
}

/// The data behind the lock is consistent after each statement.
pub(super) fn lock(inbox: &Mutex<Inbox>) -> MutexGuard<'_, Inbox> {
    inbox.lock().unwrap_or_else(PoisonError::into_inner)
}
