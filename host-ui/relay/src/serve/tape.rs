//! The last records of the core, which the keeper has: a server that was killed cannot send what was made until the next one hears.
//!
//! The server asks for them with one byte once it hears records itself. They come over the same socket, each batch behind its length.

use super::kept::Kept;
use super::watched::Watched;
use super::{Server, lock};
use crate::wire;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};
use stylet_shm_schema::affinity::Left;
use stylet_shm_schema::service::{self, Instance, MAX_BATCH, SliceSubscriber, Subscriber};
use stylet_shm_schema::{Session, TickRecord, check};

/// What the server sends to have them.
pub const ASK: u8 = 2;
/// Ten seconds of batches, 3 MB.
const AT_MOST: usize = 500;
/// A keeper that has not answered for so long has none.
const PATIENCE: Duration = Duration::from_secs(1);
const LOOK_EVERY: Duration = Duration::from_millis(5);

type Ports = (SliceSubscriber<TickRecord, u64>, Subscriber<Session>);

/// The keeper's end.
pub struct Tape {
    instance: Instance,
    ports: Watched<Ports>,
    batches: VecDeque<Vec<TickRecord>>,
    left_core: Left,
}

impl Tape {
    /// Of the core of `instance`.
    pub fn new(instance: &Instance) -> Self {
        Self {
            instance: instance.clone(),
            ports: Watched::new(),
            batches: VecDeque::new(),
            left_core: Left::default(),
        }
    }

    /// Takes what the core has sent; its queue holds 12 s.
    pub fn pass(&mut self) {
        let instance = &self.instance;
        let make = || {
            let node = instance.node()?;
            let records = service::records::subscriber(&node)?;
            Ok(((records, service::session::subscriber(&node)?), node))
        };
        let Some((records, sessions)) = self.ports.get(make) else {
            return;
        };
        let mut any = false;
        while let Some(session) = sessions.receive() {
            self.left_core.leave(&session);
        }
        while let Some(sample) = records.receive() {
            any = true;
            self.batches.push_back(sample.values().to_vec());
        }
        self.batches.drain(..self.batches.len().saturating_sub(AT_MOST));
        if any {
            self.ports.heard();
        }
    }

    /// To a server that asked; one that does not take them is not waited for.
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

/// On a thread of the server's: completes what it keeps, once it hears records itself.
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

/// All of `bytes`, from a socket that does not wait.
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
