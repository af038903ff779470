//! The threads of the streams: state and records as they arrive, and thinned snapshots.

use super::pace::Places;
use super::tape::Newest;
use super::watched::Watched;
use super::{Server, lock};
use crate::net::{Bytes, Place, Priority, put, put_newest};
use crate::wire::{self, Kind, Rest, Stamp, Thin, encode};
use std::time::{Duration, Instant};
use stylet_ports::{self as service, Node, ServiceError, SliceSubscriber, StateReader};
use stylet_shm_schema::{HapticState, Instance, SceneHeader, SnapshotHeader, TickRecord, Vertex};

/// Polling interval of the queue of records, half of which delays a batch on average.
const RECORDS_EVERY: Duration = Duration::from_micros(100);
/// Longest pause after a batch; normally most of the interval between the last two batches.
const RECORDS_PAUSE: Duration = Duration::from_millis(16);
/// Shortest interval between snapshots: 60 a second.
const SNAPSHOTS_EVERY: Duration = Duration::from_micros(16_700);
const BOARD_EVERY: Duration = Duration::from_millis(20);

/// The core's state board.
#[derive(Default)]
struct Board {
    // The reader before its node.
    reader: Option<(u64, StateReader, Node)>,
    tried: Option<Instant>,
}

impl Board {
    /// Returns the state of the run, once its board exists.
    fn state(&mut self, instance: &Instance, session_id: u64) -> Option<HapticState> {
        let is_of_it = (self.reader.as_ref()).is_some_and(|(id, _, node)| *id == session_id && node.is_current());
        if !is_of_it && self.tried.is_none_or(|tried| tried.elapsed() >= BOARD_EVERY) {
            self.tried = Some(Instant::now());
            let open = || {
                let node = Node::join(instance)?;
                Ok::<_, ServiceError>((session_id, StateReader::open(&node, session_id)?, node))
            };
            self.reader = open().ok();
        }
        let (id, board, _) = self.reader.as_ref()?;
        (*id == session_id).then(|| board.read())
    }
}

/// Sends each batch of records with the present state, and keeps it for members that miss it.
pub fn records(server: &Server) {
    let mut watched = Watched::<SliceSubscriber<TickRecord, u64>>::new();
    let (mut board, mut last, mut newest_record) = (Board::default(), Instant::now(), Newest::default());
    while !server.ends() {
        let make = |node: &Node| service::records::subscriber(node);
        let mut any = false;
        if let Some(port) = watched.get(&server.instance, make) {
            while let Some(sample) = port.receive() {
                let values = newest_record.newer(sample.values());
                if values.is_empty() {
                    continue;
                }
                any = true;
                let packed = wire::pack(&values);
                let kept = server.batch(&packed);
                let newest = match board.state(&server.instance, *sample.header()) {
                    Some(state) => server.newest(&state, &packed),
                    None => kept.clone(),
                };
                lock(&server.kept).keep(&values, kept);
                send_records(server, newest);
            }
        }
        let mut pause = RECORDS_EVERY;
        if any {
            pause = (last.elapsed() * 3 / 4).clamp(RECORDS_EVERY, RECORDS_PAUSE);
            last = Instant::now();
        }
        std::thread::sleep(pause);
    }
}

fn send_records(server: &Server, newest: Vec<u8>) {
    let seats: Vec<u16> = lock(&server.outlets).keys().copied().collect();
    let bytes = Bytes::from(newest);
    for seat in seats {
        put(&server.session, Place::To(seat), Priority::RealTime, bytes.clone());
    }
}

type Pictures = (
    SliceSubscriber<Vertex, SnapshotHeader>,
    SliceSubscriber<u32, SceneHeader>,
);

/// Sends the newest snapshot, thinned, 60 times a second, to each member as far as its line allows.
pub fn snapshots(server: &Server) {
    crate::slice::let_others_first();
    let mut watched = Watched::<Pictures>::new();
    let mut rest = Rest::default();
    while !server.ends() {
        let begun = Instant::now();
        let make = |node: &Node| {
            let snapshots = service::snapshots::subscriber(node)?;
            Ok((snapshots, service::scene::subscriber(node)?))
        };
        if let Some((snapshots, scenes)) = watched.get(&server.instance, make) {
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
                send_snapshot(server, &rest, snapshot.header(), snapshot.values());
            }
        }
        std::thread::sleep(SNAPSHOTS_EVERY.saturating_sub(begun.elapsed()));
    }
}

fn send_snapshot(server: &Server, rest: &Rest, header: &SnapshotHeader, vertices: &[Vertex]) {
    let Some(thin) = Thin::of(rest, header, vertices) else {
        return;
    };
    let (now, fingerprint) = (Instant::now(), thin.fingerprint());
    let mut messages = Vec::new();
    for (seat, pace) in lock(&server.paces).iter_mut() {
        let Some(room) = pace.room(now) else { continue };
        let number = pace.next();
        let (stride, body) = match pace.has_all(fingerprint) {
            true => (0, thin.without_places()),
            false => (thin.stride(room), thin.with_places(number, room)),
        };
        let stamp = Stamp {
            number,
            ..server.stamp()
        };
        pace.sent(now, Places { fingerprint, stride });
        messages.push((*seat, encode(Kind::Snapshot, stamp, &[&body])));
    }
    // Without the lock: this may wait for a line.
    for (seat, bytes) in messages {
        put_newest(&server.session, Place::To(seat), Priority::DataLow, bytes);
    }
}
