//! The host of a measurement: reports when it saw data, and passes requests on.

use crate::Ended;
use std::time::Duration;
use stylet_ports::{self as service, Node, Publisher, ServiceError, SliceSubscriber, Subscriber};
use stylet_shm_schema::affinity::{Left, now_ns};
use stylet_shm_schema::{Command, Event, Instance, Session, SnapshotHeader, TickRecord, Vertex};
use stylet_wall::packet::{Kind, LOOK_EVERY, SeenRecords, SeenSnapshot, Socket};

const CONNECT_EVERY: Duration = Duration::from_millis(5);

struct Ports {
    session: Subscriber<Session>,
    snapshots: SliceSubscriber<Vertex, SnapshotHeader>,
    records: SliceSubscriber<TickRecord, u64>,
    events: Subscriber<Event>,
    commands: Publisher<Command>,
    node: Node,
}

impl Ports {
    fn new(node: Node) -> Result<Self, ServiceError> {
        Ok(Self {
            session: service::session::subscriber(&node)?,
            snapshots: service::snapshots::subscriber(&node)?,
            records: service::records::subscriber(&node)?,
            events: service::events::subscriber(&node)?,
            commands: service::commands::publisher(&node)?,
            node,
        })
    }
}

/// Watches the core of `instance` until the other end of `socket` closes.
pub fn watch(instance: &Instance, socket: &mut Socket) -> Result<Ended, Ended> {
    let mut left = Left::default();
    let mut ports: Option<Ports> = None;
    loop {
        ports = ports.filter(|ports| ports.node.is_current());
        let Some(ports) = &mut ports else {
            // Waits for a core and its bridge.
            ports = Node::join(instance).and_then(Ports::new).ok();
            socket.wait(CONNECT_EVERY);
            socket.receive()?;
            continue;
        };
        while let Some(session) = ports.session.receive() {
            left.leave(&session);
        }
        while let Some(packet) = socket.receive()? {
            if let (Kind::Command, Some(command)) = (packet.kind, packet.value()) {
                // The next cycle of the script sends it again.
                let _ = ports.commands.send(command);
            }
        }
        look(ports, socket)?;
        std::thread::sleep(LOOK_EVERY);
    }
}

fn look(ports: &Ports, socket: &Socket) -> Result<(), Ended> {
    let seen_ns = now_ns();
    let mut snapshots = Vec::new();
    while let Some(sample) = ports.snapshots.receive() {
        let SnapshotHeader {
            tissue_tick, time_ns, ..
        } = *sample.header();
        snapshots.push(SeenSnapshot {
            tissue_tick,
            time_ns,
            seen_ns,
        });
    }
    let mut records = Vec::new();
    while let Some(sample) = ports.records.receive() {
        if let (Some(first), Some(last)) = (sample.values().first(), sample.values().last()) {
            records.push(SeenRecords {
                first: first.tick,
                last: last.tick,
                count: sample.values().len() as u64,
            });
        }
    }
    if !snapshots.is_empty() {
        socket.send(Kind::SeenSnapshots, bytemuck::cast_slice(&snapshots), None)?;
    }
    if !records.is_empty() {
        socket.send(Kind::SeenRecords, bytemuck::cast_slice(&records), None)?;
    }
    while let Some(event) = ports.events.receive() {
        socket.send(Kind::Event, bytemuck::bytes_of(&event), None)?;
    }
    Ok(())
}
