//! The core's last records, held by the keeper: a killed server cannot send the records made before the next one
//! listens.
//!
//! The server requests them with one byte once it receives records itself. They come over the same socket, each batch
//! preceded by its length.

use super::kept::Kept;
use super::watched::Watched;
use super::{Server, lock};
use crate::wire;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};
use stylet_ports::{self as service, Node, SliceSubscriber, Subscriber};
use stylet_shm_schema::affinity::Left;
use stylet_shm_schema::{Instance, MAX_BATCH, Session, TickRecord, check};

/// The server's request for them.
pub const ASK: u8 = 2;
/// Ten seconds of batches, 3 MB.
const AT_MOST: usize = 500;
/// Silence after which the keeper is assumed to have none.
const PATIENCE: Duration = Duration::from_secs(1);
const LOOK_EVERY: Duration = Duration::from_millis(5);

type Ports = (SliceSubscriber<TickRecord, u64>, Subscriber<Session>);

/// The keeper's end.
pub struct Tape {
    instance: Instance,
    ports: Watched<Ports>,
    batches: VecDeque<Vec<TickRecord>>,
    newest: Newest,
    left_core: Left,
}

impl Tape {
    /// Opens the tape of the core of `instance`.
    pub fn new(instance: &Instance) -> Self {
        Self {
            instance: instance.clone(),
            ports: Watched::new(),
            batches: VecDeque::new(),
            newest: Newest::default(),
            left_core: Left::default(),
        }
    }

    /// Takes the core's records; its queue holds 12 s.
    pub fn pass(&mut self) {
        let make = |node: &Node| {
            let records = service::records::subscriber(node)?;
            Ok((records, service::session::subscriber(node)?))
        };
        let Some((records, sessions)) = self.ports.get(&self.instance, make) else {
            return;
        };
        while let Some(session) = sessions.receive() {
            self.left_core.leave(&session);
        }
        while let Some(sample) = records.receive() {
            let batch = self.newest.newer(sample.values());
            if !batch.is_empty() {
                self.batches.push_back(batch);
            }
        }
        self.batches.drain(..self.batches.len().saturating_sub(AT_MOST));
    }

    /// Sends to a server that asked, without waiting for it to take them.
    pub fn send(&mut self, mut to: &UnixStream) {
        self.pass();
        let mut bytes = Vec::new();
        for batch in &self.batches {
            bytes.extend_from_slice(&(batch.len() as u32).to_le_bytes());
            bytes.extend_from_slice(bytemuck::cast_slice(batch));
        }
        bytes.extend_from_slice(&0_u32.to_le_bytes());
        let _ = to.write_all(&bytes);
    }
}

/// The newest record received: a restarted bridge sends the last 12 s again.
#[derive(Default)]
pub(super) struct Newest {
    session_id: u64,
    tick: u64,
}

impl Newest {
    /// Returns the new records of a batch.
    pub(super) fn newer(&mut self, batch: &[TickRecord]) -> Vec<TickRecord> {
        let mut newer = Vec::with_capacity(batch.len());
        for record in batch {
            if record.session_id != self.session_id || record.tick > self.tick {
                (self.session_id, self.tick) = (record.session_id, record.tick);
                newer.push(*record);
            }
        }
        newer
    }
}

/// Completes the kept batches on a thread of the server, once it receives records itself.
pub(super) fn complete(server: &Server, keeper: Option<UnixStream>) {
    let has_any = |server: &Server| lock(&server.kept).has_any();
    while !server.ends() && !has_any(server) {
        std::thread::sleep(LOOK_EVERY);
    }
    let batches = keeper.and_then(|keeper| ask(&keeper)).unwrap_or_default();
    let messages = batches.into_iter().map(|batch| {
        let bytes = server.batch(&wire::pack(&batch));
        (batch, bytes)
    });
    Kept::complete(&mut lock(&server.kept), messages);
}

fn ask(mut keeper: &UnixStream) -> Option<Vec<Vec<TickRecord>>> {
    let end = Instant::now() + PATIENCE;
    keeper.write_all(&[ASK]).ok()?;
    let mut batches = Vec::new();
    loop {
        let mut count = [0; 4];
        read(keeper, &mut count, end)?;
        let count = u32::from_le_bytes(count) as usize;
        if count == 0 || count > MAX_BATCH || batches.len() > AT_MOST {
            return (count == 0).then_some(batches);
        }
        let mut bytes = vec![0; count * size_of::<TickRecord>()];
        read(keeper, &mut bytes, end)?;
        let batch = wire::many::<TickRecord>(&bytes, MAX_BATCH).ok()?;
        if batch.iter().all(|record| check::record(record).is_ok()) {
            batches.push(batch);
        }
    }
}

/// Reads all of `bytes` from a non-blocking socket.
fn read(mut from: &UnixStream, mut bytes: &mut [u8], end: Instant) -> Option<()> {
    while !bytes.is_empty() {
        match from.read(bytes) {
            Ok(0) => return None,
            Ok(count) => bytes = &mut bytes[count..],
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                if Instant::now() >= end {
                    return None;
                }
                std::thread::sleep(Duration::from_millis(1));
            }
            Err(_) => return None,
        }
    }
    Some(())
}
