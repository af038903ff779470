//! Every port of the core, and the data through each.

use bytemuck::{AnyBitPattern, Pod};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Instant;
use stylet_ports::{
    self as service, Node, Publisher, ServiceError, SlicePublisher, SliceSubscriber, StateWriter, Subscriber, Watch,
};
use stylet_shm_schema::*;
use stylet_wall::board::Reader;
use stylet_wall::packet::{Closed, Kind, LOOK_EVERY, Packet, Socket, Start, sealed, unsealed};

/// Most requests of one port relayed in a millisecond. More are refused, so that a flood reaches neither loop. Counted by
/// port, since a host can claim any id.
const MAX_OF_A_PORT: u32 = 16;
/// Most such refusals answered in that time; the others are only counted. Every host has all answers in its queue, and
/// answers to a flooding host would displace the others.
const MAX_ANSWERED: u32 = 1;
/// Most requests taken from the queues in one pass. Queues are read one after the other, so a host that fills its queue
/// faster than it is read would block those behind it; counting a request takes less time than relaying it.
const MAX_TAKEN: usize = 8192;
/// Number of requests after which the bridge looks for stops again: a pass under the flood of ten processes takes tens
/// of milliseconds.
const STOPS_EVERY: usize = 64;

/// A service of the core: sends a packet to every host or, given none, connects new hosts and drops those that have
/// disconnected. A packet without room reaches none: hosts see a gap in the numbers.
type Outlet = (Kind, Box<dyn Fn(Option<Packet>)>);

fn values<T: AnyBitPattern>(kind: Kind, port: Publisher<T>) -> Outlet {
    let serve = move |packet: Option<Packet>| match packet {
        Some(packet) => drop(packet.value().map(|value| port.send(value))),
        None => port.connect(),
    };
    (kind, Box::new(serve))
}

fn records<T: Pod>(kind: Kind, port: SlicePublisher<T, u64>, session_id: u64) -> Outlet {
    let serve = move |packet: Option<Packet>| match packet {
        Some(packet) => drop(port.send(&session_id, &packet.values())),
        None => port.connect(),
    };
    (kind, Box::new(serve))
}

fn scene(port: SlicePublisher<u32, SceneHeader>) -> Outlet {
    let serve = move |packet: Option<Packet>| {
        let Some(packet) = packet else {
            return port.connect();
        };
        let header = packet.value();
        let words = packet.memory.and_then(|memory| unsealed(memory, usize::MAX).ok());
        if let (Some(header), Some(words)) = (header, words) {
            let _ = port.send(&header, &words);
        }
    };
    (Kind::Scene, Box::new(serve))
}

/// Every port of the core; see [`service`].
pub struct Ports {
    session_id: u64,
    outlets: Vec<Outlet>,
    snapshots: SlicePublisher<Vertex, SnapshotHeader>,
    /// Source of the scene's snapshots, and their length.
    shown: Option<(Reader<SnapshotHeader, Vertex>, usize)>,
    viewers: Watch,
    commands: Subscriber<Command>,
    stops: Subscriber<Command>,
    uploads: SliceSubscriber<u8, UploadHeader>,
    /// Taken from a queue when the force process had no room for it.
    held: Option<(Kind, Command)>,
    /// Requests refused here.
    pub refused: u64,
    taken: Taken,
    /// The latest tick.
    pub state: StateWriter<HapticState>,
    /// The latest tick of the second device, in a run with one.
    pub second: Option<StateWriter<SecondState>>,
    /// Dropped last.
    pub node: Node,
}

impl Ports {
    pub fn new(epoch: &Epoch, start: &Start) -> Result<Self, ServiceError> {
        let node = Node::open(epoch.clone())?;
        let (session_id, length, words) = (start.session_id, start.snapshot_len as usize, start.word_count as usize);
        let mut outlets = vec![
            values(Kind::Session, service::session::publisher(&node)?),
            values(Kind::Event, service::events::publisher(&node)?),
            values(Kind::Parameters, service::parameters::publisher(&node)?),
            values(Kind::Plan, service::plan::publisher(&node)?),
            values(Kind::Reply, service::replies::publisher(&node)?),
            values(Kind::Rehearsal, service::rehearsals::publisher(&node)?),
            records(
                Kind::Records,
                service::records::publisher(&node, MAX_BATCH)?,
                session_id,
            ),
            scene(service::scene::publisher(&node, words)?),
        ];
        let mut second = None;
        if start.has_second == 1 {
            second = Some(StateWriter::create(&node, session_id)?);
            let port = service::second_records::publisher(&node, MAX_BATCH)?;
            outlets.push(records(Kind::SecondRecords, port, session_id));
        }
        Ok(Self {
            session_id,
            outlets,
            snapshots: service::snapshots::publisher(&node, length)?,
            shown: None,
            viewers: service::snapshots::watch(&node)?,
            commands: service::commands::subscriber(&node)?,
            stops: service::stops::subscriber(&node)?,
            uploads: service::uploads::subscriber(&node)?,
            held: None,
            taken: Taken::new(),
            refused: 0,
            state: StateWriter::create(&node, session_id)?,
            second,
            node,
        })
    }

    /// True if a host takes snapshots.
    pub fn has_viewers(&self) -> bool {
        self.viewers.connected().subscribers > 0
    }

    /// Connects new hosts and drops those that have disconnected.
    pub fn connect(&self) {
        self.outlets.iter().for_each(|(_, serve)| serve(None));
        self.snapshots.connect();
    }

    /// Publishes a packet of the force process to every host.
    pub fn publish(&self, packet: Packet) {
        if let Some((_, serve)) = self.outlets.iter().find(|(kind, _)| *kind == packet.kind) {
            serve(Some(packet));
        }
    }

    /// Copies snapshots from `memory` from now on.
    pub fn show_snapshots(&mut self, memory: BorrowedFd, len: usize) {
        self.shown = Reader::new(memory, len).ok().map(|reader| (reader, len));
    }

    /// Sends the newest snapshot, copied straight into the memory of hosts.
    pub fn send_snapshot(&mut self) {
        let Some((reader, len)) = self.shown.as_mut().filter(|(reader, _)| reader.has_news()) else {
            return;
        };
        let Some(mut loan) = self.snapshots.loan(*len) else {
            return;
        };
        let (header, vertices) = loan.parts();
        // SAFETY: the loan is ours alone until it is sent, and has room for a header and `len` vertices.
        if unsafe { reader.take_to(header, vertices, *len) } {
            let _ = loan.send();
        }
    }

    /// Relays the requests of hosts to the force process, as far as it has room.
    pub fn forward(&mut self, socket: &Socket) -> Result<(), Closed> {
        if self.taken.since.elapsed() >= LOOK_EVERY {
            self.taken = Taken::new();
        }
        for number in 0..MAX_TAKEN {
            if number % STOPS_EVERY == 0 && !self.forward_stops(socket)? {
                return Ok(());
            }
            let Some((port, command)) = self.commands.receive_from() else {
                break;
            };
            match self.taken.admits(port) {
                true if self.hand_on(socket, Kind::Command, command)? => {}
                true => return Ok(()),
                false => {
                    let answers = self.taken.answers();
                    self.refuse(&command, answers);
                }
            }
        }
        while let Some(slice) = self.uploads.receive() {
            let header = *slice.header();
            if let Ok(memory) = sealed("stylet-upload", slice.values()) {
                socket.send(Kind::Upload, bytemuck::bytes_of(&header), Some(memory.as_fd()))?;
            }
        }
        Ok(())
    }

    /// Relays requests that remove force or motion, which have separate queues, without a limit. False if the force
    /// process has no room now.
    fn forward_stops(&mut self, socket: &Socket) -> Result<bool, Closed> {
        let next = |ports: &mut Self| match ports.held.take() {
            None => Some((Kind::Stop, ports.stops.receive()?)),
            held => held,
        };
        while let Some((kind, command)) = next(self) {
            if !self.hand_on(socket, kind, command)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Relays a command; false if the force process has no room now, in which case the command is held until it has.
    fn hand_on(&mut self, socket: &Socket, kind: Kind, command: Command) -> Result<bool, Closed> {
        let sent = socket.send(kind, bytemuck::bytes_of(&command), None)?;
        self.held = (!sent).then_some((kind, command));
        Ok(sent)
    }

    fn refuse(&mut self, command: &Command, answers: bool) {
        self.refused += 1;
        if answers {
            let asker = (command.host_id, command.command_id);
            let refusal = RefusalCode::TooManyRequests.into();
            let reply = Reply::new(self.session_id, asker, Err(&refusal));
            self.publish(Packet {
                kind: Kind::Reply,
                memory: None,
                bytes: bytemuck::bytes_of(&reply).to_vec(),
            });
        }
    }
}

/// Requests of a millisecond, or of one pass that takes longer.
struct Taken {
    since: Instant,
    of_port: Vec<(u128, u32)>,
    answered: u32,
}

impl Taken {
    fn new() -> Self {
        Self {
            since: Instant::now(),
            of_port: Vec::new(),
            answered: 0,
        }
    }

    /// Counts a request; false if it exceeds its port's limit.
    fn admits(&mut self, port: u128) -> bool {
        if let Some((_, count)) = self.of_port.iter_mut().find(|(of, _)| *of == port) {
            *count += 1;
            return *count <= MAX_OF_A_PORT;
        }
        self.of_port.push((port, 1));
        true
    }

    /// Counts a refusal; false if it is not answered.
    fn answers(&mut self) -> bool {
        self.answered += 1;
        self.answered <= MAX_ANSWERED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seven new identities in one pass used to keep another host's stop from being read.
    #[test]
    fn a_port_that_floods_is_limited_and_leaves_room_for_others() {
        let mut taken = Taken::new();
        for count in 1..=2 * MAX_OF_A_PORT {
            assert_eq!(taken.admits(1), count <= MAX_OF_A_PORT);
        }
        assert!((2..100).all(|port| taken.admits(port)));
        assert!((0..MAX_ANSWERED).all(|_| taken.answers()));
        assert!(!taken.answers());
    }
}
