//! The threads of the streams: records as they come, snapshots thinned, and what one member asks for again.

use super::{Server, lock};
use crate::net::{Place, Priority, put, put_newest, put_whole};
use crate::now_ns;
use crate::wire::{Batches, Kind, Rest, Stamp, encode, encode_snapshot};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};
use stylet_shm_schema::service::{self, Node, ServiceError, SliceSubscriber};
use stylet_shm_schema::{SceneHeader, SnapshotHeader, TickRecord, Vertex};

/// How often the queue of records is looked at: a batch waits half of it on average.
const RECORDS_EVERY: Duration = Duration::from_micros(200);
/// 60 a second at most.
const SNAPSHOTS_EVERY: Duration = Duration::from_micros(16_700);
/// Ports that have been silent for so long are made anew: another core may have swept their folder.
const SILENT_PORTS: Duration = Duration::from_secs(4);
const OPEN_EVERY: Duration = Duration::from_secs(1);

/// Ports of one thread, made again when they are silent.
struct Watched<P> {
    ports: Option<(P, Node)>,
    tried: Option<Instant>,
    heard: Instant,
}

impl<P> Watched<P> {
    fn new() -> Self {
        Self {
            ports: None,
            tried: None,
            heard: Instant::now(),
        }
    }

    fn get(&mut self, make: impl FnOnce() -> Result<(P, Node), ServiceError>) -> Option<&P> {
        let now = Instant::now();
        let is_due = self.tried.is_none_or(|tried| now - tried >= OPEN_EVERY);
        if is_due && (self.ports.is_none() || now - self.heard >= SILENT_PORTS) {
            (self.tried, self.ports, self.heard) = (Some(now), None, now);
            self.ports = make().ok();
        }
        self.ports.as_ref().map(|(ports, _)| ports)
    }
}

/// Sends each batch of records under the next number, and keeps it for those that miss it.
pub fn records(server: &Server) {
    let mut watched = Watched::<SliceSubscriber<TickRecord, u64>>::new();
    let mut number = 0;
    while !server.ends() {
        let make = || {
            let node = server.instance.node()?;
            Ok((service::records::subscriber(&node)?, node))
        };
        let mut any = false;
        if let Some(port) = watched.get(make) {
            while let Some(sample) = port.receive() {
                (number, any) = (number + 1, true);
                let stamp = Stamp {
                    run: server.run,
                    number,
                    sent_ns: now_ns(),
                    heard_ns: 0,
                };
                let bytes = encode(Kind::Records, stamp, &[bytemuck::cast_slice(sample.values())]);
                server.keep(number, bytes.clone());
                put(&server.session, Place::Records, Priority::RealTime, bytes);
            }
        }
        if any {
            watched.heard = Instant::now();
        }
        std::thread::sleep(RECORDS_EVERY);
    }
}

type Pictures = (
    SliceSubscriber<Vertex, SnapshotHeader>,
    SliceSubscriber<u32, SceneHeader>,
);

/// Sends the newest snapshot, thinned, 60 times a second, to each member as much of it as its line carries.
pub fn snapshots(server: &Server) {
    let mut watched = Watched::<Pictures>::new();
    let mut rest = Rest::default();
    while !server.ends() {
        let begun = Instant::now();
        let make = || {
            let node = server.instance.node()?;
            let snapshots = service::snapshots::subscriber(&node)?;
            Ok(((snapshots, service::scene::subscriber(&node)?), node))
        };
        let mut any = false;
        if let Some((snapshots, scenes)) = watched.get(make) {
            while let Some(sample) = scenes.receive() {
                if stylet_shm_schema::check::scene(sample.header(), sample.values()).is_ok() {
                    rest = Rest::of_scene(sample.header(), sample.values());
                }
            }
            let mut newest = None;
            while let Some(sample) = snapshots.receive() {
                newest = Some(sample);
            }
            if let Some(snapshot) = newest {
                any = true;
                send_snapshot(server, &rest, snapshot.header(), snapshot.values());
            }
        }
        if any {
            watched.heard = Instant::now();
        }
        std::thread::sleep(SNAPSHOTS_EVERY.saturating_sub(begun.elapsed()));
    }
}

fn send_snapshot(server: &Server, rest: &Rest, header: &SnapshotHeader, vertices: &[Vertex]) {
    let now = Instant::now();
    let mut messages = Vec::new();
    for (seat, pace) in lock(&server.paces).iter_mut() {
        let Some(room) = pace.room(now) else { continue };
        let Some(body) = encode_snapshot(rest, header, vertices, pace.next(), room) else {
            return;
        };
        let stamp = Stamp {
            run: server.run,
            number: pace.next(),
            sent_ns: now_ns(),
            heard_ns: 0,
        };
        pace.sent(now);
        messages.push((*seat, encode(Kind::Snapshot, stamp, &[&body])));
    }
    // Without the lock: this may wait for a line.
    for (seat, bytes) in messages {
        put_newest(&server.session, Place::To(seat), Priority::DataLow, bytes);
    }
}

/// What is sent to one member, on a thread that may wait for it.
pub enum Job {
    /// A message as it is.
    Message(u16, Vec<u8>),
    /// Batches that the member missed.
    Again(u16, Batches),
}

/// Sends what members ask for; a member that does not take it keeps nobody else waiting but those that ask too.
pub fn jobs(server: &Server, jobs: &Receiver<Job>) {
    while !server.ends() {
        match jobs.recv_timeout(Duration::from_millis(50)) {
            Ok(Job::Message(seat, bytes)) => {
                put_whole(&server.session, Place::To(seat), Priority::InteractiveLow, bytes)
            }
            Ok(Job::Again(seat, batches)) => again(server, seat, batches),
            Err(_) => {}
        }
    }
}

/// Batches sent for one request at most.
const AGAIN_AT_MOST: u64 = 64;

fn again(server: &Server, seat: u16, Batches { from, to }: Batches) {
    let to = to.min(from.saturating_add(AGAIN_AT_MOST - 1));
    let (kept, first) = server.kept(from, to);
    if first > from {
        let stamp = Stamp {
            run: server.run,
            number: 0,
            sent_ns: now_ns(),
            heard_ns: 0,
        };
        let lost = Batches { from, to: first - 1 };
        let bytes = encode(Kind::Missing, stamp, &[bytemuck::bytes_of(&lost)]);
        put_whole(&server.session, Place::To(seat), Priority::Data, bytes);
    }
    for bytes in kept {
        put_whole(&server.session, Place::To(seat), Priority::Data, bytes);
    }
}
