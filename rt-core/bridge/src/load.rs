//! A host that never pauses, as a load during a measurement: heavier than any window.

use crate::Ended;
use std::time::Duration;
use stylet_ports::{self as service, Node, ServiceError, SliceSubscriber};
use stylet_shm_schema::{Instance, SnapshotHeader, TickRecord, Vertex};
use stylet_wall::packet::Socket;

type Snapshots = SliceSubscriber<Vertex, SnapshotHeader>;
type Records = SliceSubscriber<TickRecord, u64>;

fn listen(instance: &Instance) -> Result<(Snapshots, Records, Node), ServiceError> {
    let node = Node::join(instance)?;
    Ok((
        service::snapshots::subscriber(&node)?,
        service::records::subscriber(&node)?,
        node,
    ))
}

/// Interval of connection attempts: the core starts after its load.
const CONNECT_EVERY: Duration = Duration::from_millis(25);

/// As many vertices as the largest built-in scene.
const VERTICES: usize = 50_000;

/// Copies everything that `instance` publishes, over and over, until the other end of `socket` closes.
pub fn copy_all(instance: &Instance, socket: &mut Socket) -> Result<Ended, Ended> {
    let mut ports = None;
    // Without a picture, or next to a program that publishes none, it reads as much memory.
    let mut vertices = vec![Vertex::default(); VERTICES];
    let mut kept = Vec::new();
    loop {
        socket.receive()?;
        let Some((snapshots, records, _)) = &ports else {
            ports = listen(instance).ok();
            std::thread::sleep(CONNECT_EVERY);
            continue;
        };
        let mut idle = true;
        while let Some(sample) = snapshots.receive() {
            vertices.clear();
            vertices.extend_from_slice(sample.values());
            idle = false;
        }
        while let Some(sample) = records.receive() {
            kept.clear();
            kept.extend_from_slice(sample.values());
            idle = false;
        }
        // Like a window with a picture, it reads it several times.
        for _ in 0..if idle { 1 } else { 16 } {
            std::hint::black_box(vertices.clone());
        }
    }
}
