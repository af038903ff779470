//! Ports of shared memory: those of a host beside the core, and those of a core for hosts on another machine.

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::writer::{EntryHandleMut, Writer};
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy, Node, ZeroCopySend};
use std::fmt::Debug;
use stylet_shm_schema::service::{self, Instance, Ipc, MAX_BATCH, Plain, ServiceError, Slices, StateBoard};
use stylet_shm_schema::*;

/// A subscriber of single values.
pub type From<T> = Subscriber<Ipc, T, ()>;
/// A subscriber of slices under a header.
pub type SlicesFrom<T, H> = Subscriber<Ipc, [T], H>;
/// A publisher of single values.
pub type To<T> = Publisher<Ipc, T, ()>;
/// A publisher of slices under a header.
pub type SlicesTo<T, H> = Publisher<Ipc, [T], H>;

fn failed(what: &str, why: impl Debug) -> ServiceError {
    ServiceError(format!(
        "{what}: {why:?}. At most {} hosts can watch one core, and one core or relay can serve one instance: close a window, or choose another \
         --instance",
        service::MAX_HOSTS
    ))
}

/// A subscriber of a service.
pub fn from<T: ZeroCopySend + Debug>(service: Plain<T>, what: &str) -> Result<From<T>, ServiceError> {
    service.subscriber_builder().create().map_err(|e| failed(what, e))
}

/// A subscriber of a service of slices.
pub fn slices_from<T, H>(service: Slices<T, H>, what: &str) -> Result<SlicesFrom<T, H>, ServiceError>
where
    T: ZeroCopySend + Debug,
    H: ZeroCopySend + Debug,
{
    service.subscriber_builder().create().map_err(|e| failed(what, e))
}

/// A publisher of a service.
pub fn to<T: ZeroCopySend + Debug>(service: Plain<T>, what: &str) -> Result<To<T>, ServiceError> {
    service
        .publisher_builder()
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
        .map_err(|e| failed(what, e))
}

/// A publisher of slices of `length` at first, with memory for `kept` of them or for all that hosts may hold.
pub fn slices_to<T, H>(
    service: Slices<T, H>,
    what: &str,
    length: usize,
    kept: Option<usize>,
) -> Result<SlicesTo<T, H>, ServiceError>
where
    T: ZeroCopySend + Debug,
    H: ZeroCopySend + Debug,
{
    service
        .publisher_builder()
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .allocation_strategy(AllocationStrategy::PowerOfTwo)
        .initial_max_slice_len(length)
        .override_sample_preallocation(move |all| kept.unwrap_or(all))
        .create()
        .map_err(|e| failed(what, e))
}

/// Sends a slice under its header; false when there is no room.
pub fn send_slice<T, H>(port: &SlicesTo<T, H>, header: &H, values: &[T]) -> bool
where
    T: ZeroCopySend + Debug + Copy,
    H: ZeroCopySend + Debug + Copy + Default,
{
    let Ok(mut sample) = port.loan_slice_uninit(values.len()) else {
        return false;
    };
    *sample.user_header_mut() = *header;
    sample.write_from_slice(values).send().is_ok()
}

/// What a host beside the core has but for records and snapshots, which have threads of their own.
pub struct Near {
    /// Announcements of the core.
    pub session: From<Session>,
    /// What happened.
    pub events: From<Event>,
    /// Parameters in force.
    pub parameters: From<ParametersInForce>,
    /// The plan in force.
    pub plan: From<PlanInForce>,
    /// Answers to requests of every host.
    pub replies: From<Reply>,
    /// Results of rehearsals.
    pub rehearsals: From<Rehearsal>,
    /// The scene that runs.
    pub scene: SlicesFrom<u32, SceneHeader>,
    /// Requests to the core.
    pub commands: To<Command>,
    /// Requests of hosts beside the core, and those of this port.
    pub requests: From<Command>,
    uploads: Slices<u8, UploadHeader>,
    /// The node of these ports.
    pub node: Node<Ipc>,
}

impl Near {
    /// Ports to the core of `instance`, which may not run yet.
    pub fn new(instance: &Instance) -> Result<Self, ServiceError> {
        let node = instance.node()?;
        Ok(Self {
            session: from(service::session(&node)?, "session")?,
            events: from(service::events(&node)?, "events")?,
            parameters: from(service::parameters(&node)?, "parameters")?,
            plan: from(service::plan(&node)?, "plan")?,
            replies: from(service::replies(&node)?, "replies")?,
            rehearsals: from(service::rehearsals(&node)?, "rehearsals")?,
            scene: slices_from(service::scene(&node)?, "scene")?,
            commands: to(service::commands(&node)?, "commands")?,
            requests: from(service::commands(&node)?, "commands")?,
            uploads: service::uploads(&node)?,
            node,
        })
    }

    /// A port for one volume, filled and sent; it must live until the core has mapped it.
    pub fn upload(&self, header: &UploadHeader, cells: &[u8]) -> Result<SlicesTo<u8, UploadHeader>, ServiceError> {
        let port = self
            .uploads
            .publisher_builder()
            .initial_max_slice_len(cells.len())
            .override_sample_preallocation(|_| 2)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| failed("uploads", e))?;
        match send_slice(&port, header, cells) {
            true => Ok(port),
            false => Err(failed("uploads", "no room")),
        }
    }
}

/// The blackboard of one run of the core. The entry goes first, then the reader, then the service.
pub struct Board {
    entry: EntryHandle<Ipc, u64, HapticState>,
    _reader: Reader<Ipc, u64>,
    _board: StateBoard,
}

impl Board {
    /// The board of the run `session_id`.
    pub fn open(node: &Node<Ipc>, session_id: u64) -> Result<Self, ServiceError> {
        let board = service::open_state_board(node, session_id)?;
        let reader = board.reader_builder().create().map_err(|e| failed("state", e))?;
        let entry = reader
            .entry::<HapticState>(&service::STATE_KEY)
            .map_err(|e| failed("state", e))?;
        Ok(Self {
            entry,
            _reader: reader,
            _board: board,
        })
    }

    /// The latest state.
    pub fn read(&self) -> HapticState {
        *self.entry.get()
    }
}

/// The blackboard that `join` writes.
pub struct FarBoard {
    entry: EntryHandleMut<Ipc, u64, HapticState>,
    _writer: Writer<Ipc, u64>,
    _board: StateBoard,
}

impl FarBoard {
    /// A board for the run `session_id`. It fails where a `join` that was killed has left one that a host still holds.
    pub fn create(node: &Node<Ipc>, session_id: u64) -> Result<Self, ServiceError> {
        let board = service::create_state_board(node, session_id)?;
        let writer = board.writer_builder().create().map_err(|e| failed("state", e))?;
        let entry = writer
            .entry::<HapticState>(&service::STATE_KEY)
            .map_err(|e| failed("state", e))?;
        Ok(Self {
            entry,
            _writer: writer,
            _board: board,
        })
    }

    /// Shows a state to every host.
    pub fn write(&self, state: &HapticState) {
        self.entry.update_with_copy(*state);
    }
}

/// What `join` publishes but for records and snapshots, which have threads of their own.
pub struct Far {
    /// Announcements of the core.
    pub session: To<Session>,
    /// What happened.
    pub events: To<Event>,
    /// Parameters in force.
    pub parameters: To<ParametersInForce>,
    /// The plan in force.
    pub plan: To<PlanInForce>,
    /// Answers to requests.
    pub replies: To<Reply>,
    /// Results of rehearsals.
    pub rehearsals: To<Rehearsal>,
    /// The scene that runs.
    pub scene: SlicesTo<u32, SceneHeader>,
    /// Requests of hosts here.
    pub commands: From<Command>,
    /// Volumes of hosts here.
    pub uploads: SlicesFrom<u8, UploadHeader>,
    /// The node of these ports.
    pub node: Node<Ipc>,
}

impl Far {
    /// Ports in place of a core of `instance`; fails where a core or another `join` has them.
    pub fn new(instance: &Instance) -> Result<Self, ServiceError> {
        let node = instance.node()?;
        Ok(Self {
            session: to(service::session(&node)?, "session")?,
            events: to(service::events(&node)?, "events")?,
            parameters: to(service::parameters(&node)?, "parameters")?,
            plan: to(service::plan(&node)?, "plan")?,
            replies: to(service::replies(&node)?, "replies")?,
            rehearsals: to(service::rehearsals(&node)?, "rehearsals")?,
            scene: slices_to(service::scene(&node)?, "scene", 1 << 16, Some(3))?,
            commands: from(service::commands(&node)?, "commands")?,
            uploads: slices_from(service::uploads(&node)?, "uploads")?,
            node,
        })
    }

    /// Connects hosts that came and drops those that went.
    pub fn update_connections(&self) {
        // A host that cannot be connected now is connected at the next pass.
        let _ = self.session.update_connections();
        let _ = self.events.update_connections();
        let _ = self.parameters.update_connections();
        let _ = self.plan.update_connections();
        let _ = self.replies.update_connections();
        let _ = self.rehearsals.update_connections();
        let _ = self.scene.update_connections();
    }
}

/// The port of records of a `join`, with the node that it lives on.
pub fn far_records(instance: &Instance) -> Result<(SlicesTo<TickRecord, u64>, Node<Ipc>), ServiceError> {
    let node = instance.node()?;
    Ok((slices_to(service::records(&node)?, "records", MAX_BATCH, None)?, node))
}

/// The port of snapshots of a `join`, with the node that it lives on.
pub fn far_snapshots(instance: &Instance) -> Result<(SlicesTo<Vertex, SnapshotHeader>, Node<Ipc>), ServiceError> {
    let node = instance.node()?;
    Ok((
        slices_to(service::snapshots(&node)?, "snapshots", 1 << 13, Some(16))?,
        node,
    ))
}
