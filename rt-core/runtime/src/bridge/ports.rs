//! Every port that makes connections; created and used by the bridge thread alone.

use stylet_shm_schema::service::{
    self, MAX_BATCH, Node, Publisher, ServiceError, SlicePublisher, SliceSubscriber, Subscriber, Watch,
};
use stylet_shm_schema::*;

/// One port for each service of the core; [`service`] says what each holds.
pub struct Ports {
    pub(super) session: Publisher<Session>,
    pub(super) events: Publisher<Event>,
    pub(super) parameters: Publisher<ParametersInForce>,
    pub(super) plan: Publisher<PlanInForce>,
    pub(super) replies: Publisher<Reply>,
    pub(super) rehearsals: Publisher<Rehearsal>,
    pub(super) records: SlicePublisher<TickRecord, u64>,
    pub(super) snapshots: SlicePublisher<Vertex, SnapshotHeader>,
    viewers: Watch,
    pub(super) scene: SlicePublisher<u32, SceneHeader>,
    pub(super) commands: Subscriber<Command>,
    pub(super) uploads: SliceSubscriber<u8, UploadHeader>,
}

impl Ports {
    /// Creates every port, for a scene of `word_count` words whose snapshots hold `snapshot_len` vertices and nodes.
    pub fn new(node: &Node, snapshot_len: usize, word_count: usize) -> Result<Self, ServiceError> {
        Ok(Self {
            session: service::session::publisher(node)?,
            events: service::events::publisher(node)?,
            parameters: service::parameters::publisher(node)?,
            plan: service::plan::publisher(node)?,
            replies: service::replies::publisher(node)?,
            rehearsals: service::rehearsals::publisher(node)?,
            records: service::records::publisher(node, MAX_BATCH)?,
            snapshots: service::snapshots::publisher(node, snapshot_len)?,
            viewers: service::snapshots::watch(node)?,
            scene: service::scene::publisher(node, word_count)?,
            commands: service::commands::subscriber(node)?,
            uploads: service::uploads::subscriber(node)?,
        })
    }

    /// Somebody takes snapshots.
    pub fn has_viewers(&self) -> bool {
        self.viewers.connected().subscribers > 0
    }

    /// Connects new hosts and drops those that have disconnected.
    pub fn connect(&self) {
        self.session.connect();
        self.events.connect();
        self.parameters.connect();
        self.plan.connect();
        self.replies.connect();
        self.rehearsals.connect();
        self.records.connect();
        self.snapshots.connect();
        self.scene.connect();
    }
}
