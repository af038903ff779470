//! Sends to one seat, on that seat's own threads: a member that takes nothing delays no other.

use super::Server;
use super::allowance::Allowance;
use super::lock;
use crate::net::{Bytes, Place, Priority, put_whole};
use crate::wire::{Kind, Ticks, encode};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// More messages than a greeting has.
const WAITING: usize = 512;
/// Rate of resent records: a minute of a moving hand, 18 MB, takes 14 s.
const AGAIN_BYTES: f64 = 4e6;
const AGAIN_BYTES_PER_S: f64 = 1e6;
/// Shortest interval before the same scene is resent; doubles each time.
const SCENE_AGAIN: Duration = Duration::from_secs(3);

/// The queues to a seat. Messages that do not fit are dropped; the member requests them again.
pub struct Outlet {
    messages: SyncSender<Bytes>,
    scenes: SyncSender<Bytes>,
    again: SyncSender<Ticks>,
    /// The scene sent last, the time of its next permitted resend, and the interval after that.
    scene: Option<((u64, u64), Instant, Duration)>,
}

impl Outlet {
    /// Opens the queues to a seat that is heard. The threads end when this is dropped.
    pub fn new(server: &Arc<Server>, seat: u16) -> Self {
        let (to_messages, messages) = sync_channel(WAITING);
        // None queues: one is on its way, or there is room for one.
        let (to_scenes, scenes) = sync_channel(0);
        let (to_again, missed) = sync_channel(1);
        spawn("messages", server, move |server| {
            send(server, seat, Priority::InteractiveLow, &messages);
        });
        spawn("scene", server, move |server| {
            send(server, seat, Priority::Data, &scenes)
        });
        spawn("again", server, move |server| again(server, seat, &missed));
        Self {
            messages: to_messages,
            scenes: to_scenes,
            again: to_again,
            scene: None,
        }
    }

    pub fn message(&self, bytes: Bytes) {
        let _ = self.messages.try_send(bytes);
    }

    /// Sends the scene of that identity, unless it is on its way.
    pub fn scene(&mut self, id: (u64, u64), bytes: &Bytes, now: Instant) {
        let last = self.scene.filter(|(last, ..)| *last == id);
        if last.is_some_and(|(_, due, _)| now < due) || self.scenes.try_send(bytes.clone()).is_err() {
            return;
        }
        let patience = last.map_or(SCENE_AGAIN, |(.., patience)| 2 * patience);
        self.scene = Some((id, now + patience, patience));
    }

    /// Forgets the scene: the member is another process, which has none yet.
    pub fn forget_scene(&mut self) {
        self.scene = None;
    }

    pub fn again(&self, ticks: Ticks) {
        let _ = self.again.try_send(ticks);
    }
}

fn spawn(name: &str, server: &Arc<Server>, run: impl FnOnce(&Server) + Send + 'static) {
    let server = Arc::clone(server);
    // Without the thread the queue is never emptied.
    let _ = std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(move || run(&server));
}

/// Sends queued messages; waits for a slow member, at most [`crate::net::PATIENCE_US`].
fn send(server: &Server, seat: u16, priority: Priority, all: &Receiver<Bytes>) {
    for bytes in all {
        if !server.hears(seat) {
            return;
        }
        put_whole(&server.session, Place::To(seat), priority, bytes);
    }
}

/// Resends records at a limited rate; a member that received fewer than it requested requests the rest.
fn again(server: &Server, seat: u16, missed: &Receiver<Ticks>) {
    let mut allowance = Allowance::new(AGAIN_BYTES, AGAIN_BYTES_PER_S, Instant::now());
    for ticks in missed {
        let again = lock(&server.kept).again(ticks);
        if let Some(lost) = again.lost
            && server.hears(seat)
        {
            let bytes = encode(Kind::Missing, server.stamp(), &[bytemuck::bytes_of(&lost)]);
            put_whole(&server.session, Place::To(seat), Priority::DataHigh, bytes);
        }
        for bytes in again.batches {
            if !server.hears(seat) || !allowance.take(bytes.len() as f64, Instant::now()) {
                break;
            }
            put_whole(&server.session, Place::To(seat), Priority::DataHigh, bytes.to_vec());
        }
    }
}
