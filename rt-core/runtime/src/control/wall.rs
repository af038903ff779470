//! The control thread's connection with the hosts: a bridge in another process, or a host in this one.

#[cfg(not(target_family = "wasm"))]
mod bridge;
#[cfg(not(target_family = "wasm"))]
mod child;
mod here;
#[cfg(not(target_family = "wasm"))]
mod journal;
#[cfg(not(target_family = "wasm"))]
mod kept;
#[cfg(not(target_family = "wasm"))]
mod outbox;

use crate::background::Work;
use crate::rt::shown::Shown;
#[cfg(not(target_family = "wasm"))]
pub use bridge::{Bridge, BridgeError};
#[cfg(not(target_family = "wasm"))]
pub use child::watcher;
pub use here::{Desk, Here, Told};
use std::io;
use std::time::Duration;
use stylet_shm_schema::{Command, SceneHeader, SecondRecord, TickRecord, UploadHeader};
use stylet_wall::kind::Kind;

/// Most requests taken in one pass; the rest wait.
pub const MOST_PACKETS: usize = 256;

/// A request of a host.
#[derive(Debug)]
pub enum Asked {
    /// A request as plain data.
    Command(Box<Command>),
    /// A volume and its cells.
    Volume(Box<UploadHeader>, Vec<u8>),
}

/// What the control thread needs of whoever stands between it and the hosts.
pub trait Wall {
    /// Returns the time by which the control thread goes, ns.
    fn now_ns(&self) -> u64;
    /// Returns where long work is done.
    fn work(&self) -> Work;
    /// Hosts can join.
    fn is_open(&self) -> bool;
    /// Waits for a request, at most `longest`.
    fn wait(&self, longest: Duration);
    /// Runs one pass: sends what is queued, and looks after the other side.
    fn pass(&mut self);
    /// Returns once why the other side was lost.
    fn take_lost(&mut self) -> Option<String>;
    /// Returns the next request of a host.
    fn take_asked(&mut self) -> Option<Asked>;
    /// Number of requests refused on the way.
    fn refused(&self) -> u64;
    /// Returns the newest record of the force loop.
    fn newest_record(&self) -> Option<&TickRecord>;
    /// Takes the force loop's records, and sends those of both loops that are due.
    fn take_records(&mut self, records: &mut rtrb::Consumer<TickRecord>);
    /// Takes the records of the second device's loop; returns whether it made a tick.
    fn take_second_records(&mut self, records: &mut rtrb::Consumer<SecondRecord>) -> bool;
    /// Sends the bytes of a value.
    fn put(&mut self, kind: Kind, bytes: &[u8]);
    /// Makes room for the snapshots of the next scene, of `len` vertices and nodes each.
    fn make_board(&mut self, len: usize) -> io::Result<Shown>;
    /// Shows a scene, with the board that was made for it.
    fn show_scene(&mut self, header: &SceneHeader, words: &[u32]);
}

impl dyn Wall {
    /// Sends a value: the newest of its kind, or one of the last ones.
    pub fn keep<T: bytemuck::Pod>(&mut self, kind: Kind, value: &T) {
        self.put(kind, bytemuck::bytes_of(value));
    }
}
