//! The relay next to the core: one more host of normal priority, which sends the core's publications and checks
//! members' requests.

mod allowance;
mod announce;
mod asked;
mod door;
pub mod keeper;
mod kept;
pub mod lease;
mod outlet;
mod pace;
pub mod rights;
mod rounds;
mod streams;
mod tape;
mod volume;
mod watched;

use crate::keys::{Lab, seat_of};
use crate::net::{self, Bytes, Session};
use crate::say::say;
use crate::wire::{Kind, Stamp, encode};
use crate::{RelayError, now_ns};
use door::Door;
use keeper::Beat;
use kept::Kept;
use outlet::Outlet;
use pace::Pace;
use rounds::Rounds;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use stylet_shm_schema::HapticState;
use stylet_shm_schema::Instance;

const PASS: Duration = Duration::from_millis(2);

/// Settings of a server.
#[derive(Clone, Debug)]
pub struct Options {
    /// The core's instance.
    pub instance: Instance,
    /// Addresses with ports.
    pub listen: Vec<String>,
    /// Folder of the lab's keys.
    pub lab: Lab,
}

/// State shared by a server's threads.
pub struct Server {
    session: Session,
    instance: Instance,
    run: u64,
    // SYNC: a flag alone; no data is published by it.
    end: AtomicBool,
    kept: Mutex<Kept>,
    door: Door,
    /// Seats that receive the core's data: their members are in the list, and are heard. No other seat receives any.
    outlets: Mutex<BTreeMap<u16, Outlet>>,
    /// Pace of each seat.
    paces: Mutex<BTreeMap<u16, Pace>>,
}

/// Form of a request's arrival.
struct Asked {
    seat: u16,
    bytes: Vec<u8>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The data behind the locks is consistent after each statement.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Server {
    fn ends(&self) -> bool {
        // SYNC: see the field.
        self.end.load(Ordering::Relaxed)
    }

    fn hears(&self, seat: u16) -> bool {
        lock(&self.outlets).contains_key(&seat)
    }

    /// Sends to every seat that receives the core's data.
    fn to_all(&self, bytes: Vec<u8>) {
        let bytes = Bytes::from(bytes);
        lock(&self.outlets)
            .values()
            .for_each(|outlet| outlet.message(bytes.clone()));
    }

    fn stamp(&self) -> Stamp {
        Stamp {
            run: self.run,
            number: 0,
            sent_ns: now_ns(),
            heard_ns: 0,
        }
    }

    /// Returns the message with the state and the newest batch of records.
    fn newest(&self, state: &HapticState, packed: &[u8]) -> Vec<u8> {
        let parts = [bytemuck::bytes_of(state), packed];
        encode(Kind::Newest, self.stamp(), &parts)
    }

    /// Returns the message with a packed batch of records.
    fn batch(&self, packed: &[u8]) -> Vec<u8> {
        encode(Kind::Records, self.stamp(), &[packed])
    }
}

/// Serves until `stop`; reports to `beat` on each pass whether a remote member operates.
pub fn run(options: &Options, stop: &AtomicBool, beat: &mut Beat) -> Result<(), RelayError> {
    // Before any thread starts, including zenoh's.
    crate::slice::shorten();
    let members = options.lab.members()?;
    let session = net::serve(&options.listen, &options.lab.identity()?)?;
    let server = Arc::new(Server {
        session: session.clone(),
        instance: options.instance.clone(),
        run: now_ns(),
        end: AtomicBool::new(false),
        kept: Mutex::new(Kept::default()),
        door: Door::default(),
        outlets: Mutex::new(BTreeMap::new()),
        paces: Mutex::new(BTreeMap::new()),
    });
    server.door.admit(&members);
    // The door limits the queue of each seat separately.
    let (to_asked, asked) = channel();
    let doorkeeper = Arc::clone(&server);
    net::hear(&session, &net::every_ask(), move |key, bytes| {
        // The access rules let a certificate publish under its own seat alone.
        if let Some(seat) = key.rsplit('/').next().and_then(seat_of)
            && doorkeeper.door.lets_in(seat, bytes, Instant::now())
        {
            let _ = to_asked.send(Asked {
                seat,
                bytes: bytes.to_vec(),
            });
        }
    })?;
    let keeper = beat.keeper();
    let threads = [
        spawn("records", &server, streams::records),
        spawn("snapshots", &server, streams::snapshots),
        spawn("before", &server, move |server| tape::complete(server, keeper)),
    ];
    say(format!(
        "serving instance \"{}\" on {}",
        options.instance.name(),
        options.listen.join(", ")
    ));
    let rounds = Rounds::new(Arc::clone(&server), options.lab.clone(), members);
    let end = rounds.map(|rounds| serve(rounds, &asked, stop, beat));
    // SYNC: see the field.
    server.end.store(true, Ordering::Relaxed);
    lock(&server.outlets).clear();
    for thread in threads {
        let _ = thread.map(std::thread::JoinHandle::join);
    }
    net::close(session);
    end
}

fn serve(mut rounds: Rounds, asked: &Receiver<Asked>, stop: &AtomicBool, beat: &mut Beat) {
    // SYNC: set by a signal; nothing but the flag is carried.
    while !stop.load(Ordering::Relaxed) {
        rounds.pass();
        beat.pass(rounds.is_operated_from_the_net());
        // An operator's promise does not wait for the next pass, and no flood delays it.
        let next = Instant::now() + PASS;
        while let Some(left) = next.checked_duration_since(Instant::now())
            && let Ok(request) = asked.recv_timeout(left)
        {
            rounds.server.door.took(request.seat);
            rounds.take(request.seat, &request.bytes);
        }
    }
    rounds.stop_hand_of_the_net("the relay ends");
    // The core polls every 2 ms; the ports close when this thread ends.
    std::thread::sleep(10 * PASS);
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
