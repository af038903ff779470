//! Beside the core: one more host of normal priority, which sends what the core publishes and checks what members ask.

mod announce;
mod asked;
pub mod keeper;
mod kept;
pub mod lease;
mod pace;
pub mod rights;
mod rounds;
mod streams;
mod tape;
mod watched;

use crate::keys::{Lab, seat_of};
use crate::net::{self, Session};
use crate::say::say;
use crate::wire::{Kind, Stamp, encode};
use crate::{RelayError, now_ns};
use keeper::Beat;
use kept::Kept;
use pace::Pace;
use rounds::Rounds;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use streams::Jobs;
use stylet_shm_schema::HapticState;
use stylet_shm_schema::Instance;

/// Requests that may wait; more are dropped and counted.
const ASKED: usize = 512;
const JOBS: usize = 1024;
const PASS: Duration = Duration::from_millis(2);

/// How to serve.
#[derive(Clone, Debug)]
pub struct Options {
    /// The core's instance.
    pub instance: Instance,
    /// Addresses with ports.
    pub listen: Vec<String>,
    /// Folder of the lab's keys.
    pub lab: Lab,
}

/// What the threads of a server share.
pub struct Server {
    session: Session,
    instance: Instance,
    run: u64,
    // SYNC: a flag alone, no data is published by it.
    end: AtomicBool,
    kept: Mutex<Kept>,
    /// Of each member that is connected.
    paces: Mutex<BTreeMap<u16, Pace>>,
    /// Seats to which a scene is on its way: whoever asks again has one coming.
    scenes_away: Mutex<BTreeSet<u16>>,
}

/// What one request came as.
struct Asked {
    seat: u16,
    bytes: Vec<u8>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What is behind the locks is whole after each statement.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Server {
    fn ends(&self) -> bool {
        // SYNC: see the field.
        self.end.load(Ordering::Relaxed)
    }

    fn stamp(&self) -> Stamp {
        Stamp {
            run: self.run,
            number: 0,
            sent_ns: now_ns(),
            heard_ns: 0,
        }
    }

    /// The message that carries the state and the newest batch of records.
    fn newest(&self, state: &HapticState, packed: &[u8]) -> Vec<u8> {
        let parts = [bytemuck::bytes_of(state), packed];
        encode(Kind::Newest, self.stamp(), &parts)
    }

    /// The message that carries a packed batch of records.
    fn batch(&self, packed: &[u8]) -> Vec<u8> {
        encode(Kind::Records, self.stamp(), &[packed])
    }
}

/// Why serving ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// It was asked to.
    Stopped,
    /// Somebody was revoked, or somebody's time has ended: the next session shuts that seat out.
    Closed,
}

/// Serves until `stop`; `beat` has with each pass whether somebody on the net operates.
pub fn run(options: &Options, stop: &AtomicBool, beat: &mut Beat) -> Result<End, RelayError> {
    // Before there are threads, of zenoh as well.
    crate::slice::shorten();
    let members = options.lab.members()?;
    let session = net::serve(&options.listen, &options.lab.identity()?, &members.closed())?;
    let server = Arc::new(Server {
        session: session.clone(),
        instance: options.instance.clone(),
        run: now_ns(),
        end: AtomicBool::new(false),
        kept: Mutex::new(Kept::default()),
        paces: Mutex::new(BTreeMap::new()),
        scenes_away: Mutex::new(BTreeSet::new()),
    });
    let (to_asked, asked) = sync_channel(ASKED);
    net::hear(&session, &net::every_ask(), move |key, bytes| {
        // The access rules let a certificate put under its own seat alone.
        if let Some(seat) = key.rsplit('/').next().and_then(seat_of) {
            let _ = to_asked.try_send(Asked {
                seat,
                bytes: bytes.to_vec(),
            });
        }
    })?;
    let (to_messages, messages) = sync_channel(JOBS);
    let (to_scenes, scenes) = sync_channel(JOBS);
    let (to_again, missed) = sync_channel(JOBS);
    let jobs = Jobs {
        messages: to_messages,
        scenes: to_scenes,
        again: to_again,
    };
    let keeper = beat.keeper();
    let threads = [
        spawn("records", &server, streams::records),
        spawn("snapshots", &server, streams::snapshots),
        spawn("messages", &server, move |server| streams::messages(server, &messages)),
        spawn("scenes", &server, move |server| streams::scenes(server, &scenes)),
        spawn("again", &server, move |server| streams::again(server, &missed)),
        spawn("before", &server, move |server| tape::complete(server, keeper)),
    ];
    say(format!(
        "serving instance \"{}\" on {}",
        options.instance.name(),
        options.listen.join(", ")
    ));
    let rounds = Rounds::new(Arc::clone(&server), options.lab.clone(), members, jobs);
    let end = rounds.and_then(|rounds| serve(rounds, &asked, stop, beat));
    // SYNC: see the field.
    server.end.store(true, Ordering::Relaxed);
    for thread in threads {
        let _ = thread.map(std::thread::JoinHandle::join);
    }
    net::close(session);
    end
}

fn serve(mut rounds: Rounds, asked: &Receiver<Asked>, stop: &AtomicBool, beat: &mut Beat) -> Result<End, RelayError> {
    let end = loop {
        // SYNC: set by a signal; nothing but the flag is carried.
        if stop.load(Ordering::Relaxed) {
            break End::Stopped;
        }
        if rounds.pass() {
            break End::Closed;
        }
        for request in asked.try_iter().take(ASKED) {
            rounds.take(request.seat, &request.bytes);
        }
        beat.pass(rounds.is_operated_from_the_net());
        std::thread::sleep(PASS);
    };
    rounds.stop_hand_of_the_net("the relay ends");
    // The core looks every 2 ms; the ports go with this thread's end.
    std::thread::sleep(10 * PASS);
    Ok(end)
}

fn spawn(
    name: &str,
    server: &Arc<Server>,
    run: impl FnOnce(&Server) + Send + 'static,
) -> Result<std::thread::JoinHandle<()>, std::io::Error> {
    let server = Arc::clone(server);
    std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(move || run(&server))
}
