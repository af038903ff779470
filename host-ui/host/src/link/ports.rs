//! Every port that a host holds, made together and dropped together.

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{BackpressureStrategy, Node, ZeroCopySend};
use std::fmt::Debug;
use stylet_shm_schema::service::{self, Instance, Ipc, Plain, ServiceError, Slices, StateBoard};
use stylet_shm_schema::*;

pub type From<T> = Subscriber<Ipc, T, ()>;
pub type SlicesFrom<T, H> = Subscriber<Ipc, [T], H>;
pub type UploadPort = Publisher<Ipc, [u8], UploadHeader>;

// Ports before the node, so that they go first.
pub struct Ports {
    pub session: From<Session>,
    pub events: From<Event>,
    pub parameters: From<ParametersInForce>,
    pub plan: From<PlanInForce>,
    pub replies: From<Reply>,
    pub rehearsals: From<Rehearsal>,
    pub records: SlicesFrom<TickRecord, u64>,
    pub snapshots: SlicesFrom<Vertex, SnapshotHeader>,
    pub scene: SlicesFrom<u32, SceneHeader>,
    pub commands: Publisher<Ipc, Command, ()>,
    uploads: Slices<u8, UploadHeader>,
    pub node: Node<Ipc>,
}

pub fn failed(what: &str, why: impl Debug) -> ServiceError {
    ServiceError(format!(
        "{what}: {why:?}. At most {} hosts can watch one core; close another window, or check the room in /dev/shm",
        service::MAX_HOSTS
    ))
}

fn from<T: ZeroCopySend + Debug>(service: Plain<T>, what: &str) -> Result<From<T>, ServiceError> {
    service.subscriber_builder().create().map_err(|e| failed(what, e))
}

fn slices_from<T, H>(service: Slices<T, H>, what: &str) -> Result<SlicesFrom<T, H>, ServiceError>
where
    T: ZeroCopySend + Debug,
    H: ZeroCopySend + Debug,
{
    service.subscriber_builder().create().map_err(|e| failed(what, e))
}

impl Ports {
    pub fn new(instance: &Instance) -> Result<Self, ServiceError> {
        let node = instance.node()?;
        Ok(Self {
            session: from(service::session(&node)?, "session")?,
            events: from(service::events(&node)?, "events")?,
            parameters: from(service::parameters(&node)?, "parameters")?,
            plan: from(service::plan(&node)?, "plan")?,
            replies: from(service::replies(&node)?, "replies")?,
            rehearsals: from(service::rehearsals(&node)?, "rehearsals")?,
            records: slices_from(service::records(&node)?, "records")?,
            snapshots: slices_from(service::snapshots(&node)?, "snapshots")?,
            scene: slices_from(service::scene(&node)?, "scene")?,
            commands: service::commands(&node)?
                .publisher_builder()
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
                .map_err(|e| failed("commands", e))?,
            uploads: service::uploads(&node)?,
            node,
        })
    }

    /// A port for one upload: its memory is as large as the volume, and the core maps all of it.
    pub fn upload_port(&self, cells: usize) -> Result<UploadPort, ServiceError> {
        self.uploads
            .publisher_builder()
            .initial_max_slice_len(cells)
            .override_sample_preallocation(|_| 2)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| failed("uploads", e))
    }
}

/// The blackboard of one run. The entry goes first, then the reader, then the service.
pub struct Board {
    entry: EntryHandle<Ipc, u64, HapticState>,
    _reader: Reader<Ipc, u64>,
    _board: StateBoard,
}

impl Board {
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

    pub fn read(&self) -> HapticState {
        *self.entry.get()
    }
}
