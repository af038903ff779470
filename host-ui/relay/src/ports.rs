//! Ports of shared memory: those of a host next to the core, and those of a core for hosts on another machine.

use crate::class::ClassPorts;
use std::cell::RefCell;
use std::collections::VecDeque;
use stylet_ports::{
    self as service, Meeting, Node, Publisher, ServiceError, SlicePublisher, SliceSubscriber, Subscriber,
};
use stylet_shm_schema::*;

/// Ports of a host next to the core, except records and snapshots, which have their own threads.
pub struct Near {
    /// Announcements of the core.
    pub session: Subscriber<Session>,
    /// Events.
    pub events: Subscriber<Event>,
    /// Parameters in force.
    pub parameters: Subscriber<ParametersInForce>,
    /// The plan in force.
    pub plan: Subscriber<PlanInForce>,
    /// Answers to requests of every host.
    pub replies: Subscriber<Reply>,
    /// Results of rehearsals.
    pub rehearsals: Subscriber<Rehearsal>,
    /// The running scene.
    pub scene: SliceSubscriber<u32, SceneHeader>,
    commands: Publisher<Command>,
    stops: Publisher<Command>,
    requests: Subscriber<Command>,
    /// Host and number of requests sent from here that have not come back over `requests`.
    sent: RefCell<VecDeque<(u64, u64)>>,
    /// The node of these ports.
    pub node: Node,
}

/// Most requests that may be on their way back.
const SENT_AT_MOST: usize = 1024;

impl Near {
    /// Opens ports to the core in the epoch of `node`.
    pub fn new(node: Node) -> Result<Self, ServiceError> {
        Ok(Self {
            session: service::session::subscriber(&node)?,
            events: service::events::subscriber(&node)?,
            parameters: service::parameters::subscriber(&node)?,
            plan: service::plan::subscriber(&node)?,
            replies: service::replies::subscriber(&node)?,
            rehearsals: service::rehearsals::subscriber(&node)?,
            scene: service::scene::subscriber(&node)?,
            commands: service::commands::publisher(&node)?,
            stops: service::stops::publisher(&node)?,
            requests: service::commands::subscriber(&node)?,
            sent: RefCell::default(),
            node,
        })
    }

    /// Sends a request to the core.
    pub fn ask(&self, command: Command) -> Result<(), ServiceError> {
        if CommandKind::is_stop(command.kind) {
            let _ = self.stops.send(command);
        }
        let sent = self.commands.send(command);
        let service = "commands";
        sent.map_err(|why| ServiceError::Send { service, why })?;
        let mut all = self.sent.borrow_mut();
        all.push_back((command.host_id, command.command_id));
        if all.len() > SENT_AT_MOST {
            all.pop_front();
        }
        Ok(())
    }

    /// Returns the next request of another host next to the core.
    pub fn request_of_others(&self) -> Option<Command> {
        loop {
            let command = self.requests.receive()?;
            let mut sent = self.sent.borrow_mut();
            let own = sent.iter().position(|id| *id == (command.host_id, command.command_id));
            if own.and_then(|at| sent.remove(at)).is_none() {
                return Some(command);
            }
        }
    }

    /// Opens a port for one volume, filled and sent; it must live until the core has mapped it.
    pub fn upload(
        &self,
        header: &UploadHeader,
        cells: &[u8],
    ) -> Result<SlicePublisher<u8, UploadHeader>, ServiceError> {
        let port = service::uploads::publisher(&self.node, cells.len())?;
        let service = "uploads";
        port.send(header, cells)
            .map_err(|why| ServiceError::Send { service, why })?;
        Ok(port)
    }
}

/// Ports published by `join`, except records and snapshots, which have their own threads.
pub struct Far {
    /// Announcements of the core.
    pub session: Publisher<Session>,
    /// Events.
    pub events: Publisher<Event>,
    /// Parameters in force.
    pub parameters: Publisher<ParametersInForce>,
    /// The plan in force.
    pub plan: Publisher<PlanInForce>,
    /// Answers to requests.
    pub replies: Publisher<Reply>,
    /// Results of rehearsals.
    pub rehearsals: Publisher<Rehearsal>,
    /// State of the connection.
    pub relayed: Publisher<Relayed>,
    /// The class, and requests of hosts here for the lease.
    pub class: ClassPorts,
    /// The running scene.
    pub scene: SlicePublisher<u32, SceneHeader>,
    /// Requests of hosts here.
    pub commands: Subscriber<Command>,
    /// Volumes of hosts here.
    pub uploads: SliceSubscriber<u8, UploadHeader>,
    /// The core's meeting point here, with the node of these ports.
    pub meeting: Meeting,
}

impl Far {
    /// Opens the ports of a core of `instance`; fails if a core or another `join` has them.
    pub fn new(instance: &Instance) -> Result<Self, ServiceError> {
        let meeting = Meeting::new(instance)?;
        let node = &meeting.node;
        let far = Self {
            session: service::session::publisher(node)?,
            events: service::events::publisher(node)?,
            parameters: service::parameters::publisher(node)?,
            plan: service::plan::publisher(node)?,
            replies: service::replies::publisher(node)?,
            rehearsals: service::rehearsals::publisher(node)?,
            relayed: service::relayed::publisher(node)?,
            class: ClassPorts::new(node)?,
            scene: service::scene::publisher(node, 1 << 16)?,
            commands: service::commands::subscriber(node)?,
            uploads: service::uploads::subscriber(node)?,
            meeting,
        };
        far.meeting.open()?;
        Ok(far)
    }

    /// Connects new hosts and drops those that left.
    pub fn connect(&self) {
        self.session.connect();
        self.events.connect();
        self.parameters.connect();
        self.plan.connect();
        self.replies.connect();
        self.rehearsals.connect();
        self.relayed.connect();
        self.class.connect();
        self.scene.connect();
    }
}

/// Opens the port of records of a `join`, with its node.
pub fn far_records(instance: &Instance) -> Result<(SlicePublisher<TickRecord, u64>, Node), ServiceError> {
    let node = Node::join(instance)?;
    Ok((service::records::publisher(&node, MAX_BATCH)?, node))
}

/// Opens the port of snapshots of a `join`, with its node.
pub fn far_snapshots(instance: &Instance) -> Result<(SlicePublisher<Vertex, SnapshotHeader>, Node), ServiceError> {
    let node = Node::join(instance)?;
    Ok((service::snapshots::publisher(&node, 1 << 13)?, node))
}
