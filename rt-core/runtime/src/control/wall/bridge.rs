//! The wall to a bridge: starts the bridge, sends it everything for hosts, and restarts it when it
//! fails.
//!
//! Input from the bridge is untrusted. State for a new bridge is kept here: the newest of each state, the last events
//! and answers, and 12 s of records.

use super::child::{Running, SILENT_AFTER, program};
use super::journal::Journal;
use super::kept::Kept;
use super::outbox::Outbox;
use super::{Asked, MOST_PACKETS, Wall};
use crate::background::Work;
use crate::rt::clock;
use crate::rt::shown::Shown;
use std::collections::VecDeque;
use std::io;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::process::{Child, Command as Process, Stdio};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use stylet_shm_schema::*;
use stylet_wall::board::Writer;
use stylet_wall::packet::{Alive, BoardSize, Kind, Socket, Start, sealed, unsealed};

/// Interval between checks for complaints of hosts, and shortest life of an epoch.
const COMPLAINTS_EVERY: Duration = Duration::from_millis(100);
const SHORTEST_EPOCH: Duration = Duration::from_secs(2);
const FIRST_START: Duration = Duration::from_secs(20);
const RETRY_EVERY: Duration = Duration::from_millis(200);
/// Largest volume that a host may send, in cells.
const MOST_CELLS: usize = 64 << 20;

/// Failure to start the bridge at the beginning of a run.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// The folder of the instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The program cannot be started.
    #[error("cannot start {program}: {why}. It comes with rt-core: build or install both")]
    Spawn {
        /// Path of the program.
        program: String,
        /// Error of the operating system.
        why: std::io::Error,
    },
    /// The bridge started and then ended.
    #[error("{0}")]
    Failed(String),
}

/// The force process's connection to its bridge; one per run.
pub struct Bridge {
    running: Option<Running>,
    outbox: Outbox,
    kept: Kept,
    program: PathBuf,
    /// Records of the force loop.
    records: Journal<TickRecord>,
    /// Records of the second device's loop.
    second_records: Journal<SecondRecord>,
    asked: VecDeque<Asked>,
    /// A host takes snapshots: read by the tissue loop.
    is_watched: Arc<AtomicBool>,
    /// Requests refused by the bridges of this run.
    refused: u64,
    tried: Instant,
    /// Time of the last check for complaints.
    looked: Instant,
    /// Why the last bridge ended, until it is taken.
    lost: Option<String>,
    /// Killed, but not reaped yet.
    dying: Vec<Child>,
    /// Board of the scene that is shown next.
    made: Option<(BoardSize, OwnedFd)>,
    /// Last field, so dropped last: dropping it removes the instance's files.
    owned: Owned,
}

impl Bridge {
    /// Starts the first bridge, with the boards of the force loop and of the second device's loop, and waits until its
    /// ports are open.
    pub fn new(
        owned: Owned,
        start: Start,
        (state, second_state): (OwnedFd, Option<OwnedFd>),
        is_watched: Arc<AtomicBool>,
    ) -> Result<Self, BridgeError> {
        let mut wall = Self {
            running: None,
            outbox: Outbox::default(),
            kept: Kept::default(),
            program: program(),
            records: Journal::new(Kind::Records),
            second_records: Journal::new(Kind::SecondRecords),
            asked: VecDeque::new(),
            is_watched,
            refused: 0,
            tried: Instant::now(),
            looked: Instant::now(),
            lost: None,
            dying: Vec::new(),
            made: None,
            owned,
        };
        wall.put(Kind::Start, bytemuck::bytes_of(&start));
        wall.keep_with(Kind::State, &[], Some(state));
        if let Some(board) = second_state {
            wall.keep_with(Kind::SecondState, &[], Some(board));
        }
        wall.spawn()?;
        let begun = Instant::now();
        while !wall.is_open() {
            wall.wait(Duration::from_millis(20));
            wall.pass();
            let is_over = wall.running.is_none() || begun.elapsed() > FIRST_START;
            if let Some(why) = wall.lost.take_if(|_| is_over) {
                return Err(BridgeError::Failed(why));
            }
        }
        Ok(wall)
    }

    /// Sends records that are due, or all if `at_once`.
    fn send_records(&mut self, at_once: bool) {
        self.records.send(&mut self.outbox, at_once);
        self.second_records.send(&mut self.outbox, at_once);
    }

    /// Sends a value to the bridge with the memory that belongs to it, and keeps it for the next one.
    fn keep_with(&mut self, kind: Kind, bytes: &[u8], memory: Option<OwnedFd>) {
        let packet = (kind, bytes.to_vec(), memory.map(Rc::new));
        self.outbox.put(packet.clone());
        self.kept.put(packet);
    }

    fn spawn(&mut self) -> Result<(), BridgeError> {
        self.tried = Instant::now();
        self.owned.clear();
        let epoch = self.owned.begin()?;
        let failed = |why| BridgeError::Spawn {
            program: self.program.display().to_string(),
            why,
        };
        let (socket, end) = Socket::pair().map_err(failed)?;
        // No `pre_exec`: then the child is made without a copy of this process's page tables, which would cost its
        // loops page faults.
        let child = Process::new(&self.program)
            .arg(epoch.instance().name())
            .arg(epoch.folder())
            .arg(epoch.token())
            .stdin(Stdio::from(end))
            .stdout(Stdio::null())
            .spawn()
            .map_err(failed)?;
        self.running = Some(Running::new(child, epoch));
        self.outbox = Outbox {
            socket: Some(socket),
            ..Outbox::default()
        };
        self.kept.packets().for_each(|packet| self.outbox.put(packet.clone()));
        self.records.rewind();
        self.second_records.rewind();
        Ok(())
    }

    fn end_bridge(&mut self) {
        self.refused = self.refused();
        // SYNC: read by the tissue loop; nothing but the flag is carried.
        self.is_watched.store(false, Ordering::Relaxed);
        if let Some(mut running) = self.running.take() {
            let _ = running.child.kill();
            self.dying.push(running.child);
            if running.is_ready {
                // Retry at once; a bridge that never came up is retried after a pause.
                self.tried = self.tried.checked_sub(RETRY_EVERY).unwrap_or(self.tried);
            }
        }
        self.outbox = Outbox::default();
        self.owned.clear();
    }

    fn receive(&mut self) {
        while self.asked.len() < MOST_PACKETS {
            let Some(packet) = self.outbox.receive() else { return };
            let Some(running) = &mut self.running else { return };
            match packet.kind {
                Kind::Ready if !running.is_ready => {
                    running.is_ready = true;
                    if let Err(why) = self.owned.announce(&running.epoch) {
                        self.lost = Some(why.to_string());
                    }
                }
                Kind::Alive => {
                    if let Some(Alive { has_viewers, refused }) = packet.value() {
                        running.hear(refused);
                        // SYNC: read by the tissue loop; nothing but the flag is carried.
                        self.is_watched.store(has_viewers > 0, Ordering::Relaxed);
                    }
                }
                Kind::Failed => self.lost = Some(Text::<200>::new(&String::from_utf8_lossy(&packet.bytes)).read()),
                Kind::Stop => {
                    if let Some(stop) = packet.value().map(Box::new) {
                        self.asked.push_front(Asked::Command(stop));
                    }
                }
                Kind::Command => self.asked.extend(packet.value().map(Box::new).map(Asked::Command)),
                Kind::Upload => {
                    let header = packet.value::<UploadHeader>();
                    let cells = packet.memory.and_then(|memory| unsealed(memory, MOST_CELLS).ok());
                    let volume = header
                        .zip(cells)
                        .map(|(header, cells)| Asked::Volume(Box::new(header), cells));
                    self.asked.extend(volume);
                }
                // Kinds that only this side sends, or duplicates.
                _ => {}
            }
        }
    }

    /// Returns why the bridge must be restarted.
    fn trouble(&mut self) -> Option<String> {
        let running = self.running.as_mut()?;
        if let Some(why) = running.end(self.outbox.is_closed) {
            return Some(self.lost.take().unwrap_or(why));
        }
        if self.looked.elapsed() >= COMPLAINTS_EVERY {
            self.looked = Instant::now();
            // A host that writes out of bounds may have written here: no other host would then find the core.
            if running.is_ready && self.owned.instance().epoch().as_ref() != Some(&running.epoch) {
                let _ = self.owned.announce(&running.epoch);
            }
            if self.tried.elapsed() >= SHORTEST_EPOCH && self.owned.hears_complaint(&running.epoch) {
                return Some("a host cannot use the shared memory, which some host has damaged".to_owned());
            }
        }
        let silent = running.is_silent()?;
        Some(format!("it said nothing for {:.1} s", silent.as_secs_f64()))
    }
}

impl Wall for Bridge {
    fn now_ns(&self) -> u64 {
        clock::now_ns()
    }

    fn work(&self) -> Work {
        Work::Threads
    }

    fn is_open(&self) -> bool {
        self.running.as_ref().is_some_and(|running| running.is_ready)
    }

    fn wait(&self, longest: Duration) {
        match &self.outbox.socket {
            Some(socket) => socket.wait(longest),
            None => std::thread::sleep(longest),
        }
    }

    /// Takes the bridge's packets too, and checks that it lives.
    fn pass(&mut self) {
        self.outbox.flush();
        self.receive();
        self.dying.retain_mut(|child| matches!(child.try_wait(), Ok(None)));
        if let Some(why) = self.trouble() {
            self.end_bridge();
            self.lost = Some(why);
        }
        if self.running.is_none()
            && self.tried.elapsed() >= RETRY_EVERY
            && let Err(why) = self.spawn()
        {
            self.lost = Some(why.to_string());
        }
    }

    fn take_lost(&mut self) -> Option<String> {
        self.lost.take()
    }

    /// In order, but those of the queue of stops first.
    fn take_asked(&mut self) -> Option<Asked> {
        self.receive();
        self.asked.pop_front()
    }

    fn refused(&self) -> u64 {
        self.refused + self.running.as_ref().map_or(0, |running| running.refused)
    }

    fn newest_record(&self) -> Option<&TickRecord> {
        self.records.newest()
    }

    fn take_records(&mut self, records: &mut rtrb::Consumer<TickRecord>) {
        self.records.take(records);
        self.send_records(false);
    }

    fn take_second_records(&mut self, records: &mut rtrb::Consumer<SecondRecord>) -> bool {
        self.second_records.take(records)
    }

    fn put(&mut self, kind: Kind, bytes: &[u8]) {
        self.keep_with(kind, bytes, None);
    }

    fn make_board(&mut self, len: usize) -> io::Result<Shown> {
        let (writer, memory) = Writer::new("stylet-snapshots", len)?;
        self.made = Some((BoardSize { len: len as u64 }, memory));
        Ok(Shown::Board(writer))
    }

    fn show_scene(&mut self, header: &SceneHeader, words: &[u32]) {
        if let Some((size, board)) = self.made.take() {
            self.keep_with(Kind::Snapshots, bytemuck::bytes_of(&size), Some(board));
        }
        match sealed("stylet-scene", words) {
            Ok(words) => self.keep_with(Kind::Scene, bytemuck::bytes_of(header), Some(words)),
            Err(why) => eprintln!("rt-core: the scene cannot be shown: {why}"),
        }
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        let begun = Instant::now();
        self.send_records(true);
        while !self.outbox.waiting.is_empty() && !self.outbox.is_closed && begun.elapsed() < SILENT_AFTER {
            std::thread::sleep(Duration::from_millis(1));
            self.outbox.flush();
            self.send_records(true);
        }
        // Reads the last packets before the other end sees that this one is closed.
        self.outbox = Outbox::default();
        if let Some(mut running) = self.running.take() {
            let ended = Instant::now();
            while matches!(running.child.try_wait(), Ok(None)) {
                if ended.elapsed() > SILENT_AFTER {
                    let _ = running.child.kill();
                }
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }
}
