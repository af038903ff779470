//! Every port that makes connections; created and used by the bridge thread alone.

use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{AllocationStrategy, BackpressureStrategy};
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use stylet_shm_schema::service::{self, Ipc, MAX_BATCH, SNAPSHOTS_AHEAD, ServiceError};
use stylet_shm_schema::*;

/// One port for each service of the core; [`service`] says what each holds.
pub struct Ports {
    pub(super) session: Publisher<Ipc, Session, ()>,
    pub(super) events: Publisher<Ipc, Event, ()>,
    pub(super) parameters: Publisher<Ipc, ParametersInForce, ()>,
    pub(super) plan: Publisher<Ipc, PlanInForce, ()>,
    pub(super) replies: Publisher<Ipc, Reply, ()>,
    pub(super) rehearsals: Publisher<Ipc, Rehearsal, ()>,
    pub(super) records: Publisher<Ipc, [TickRecord], u64>,
    pub(super) snapshots: Publisher<Ipc, [Vertex], SnapshotHeader>,
    snapshot_service: PortFactory<Ipc, [Vertex], SnapshotHeader>,
    pub(super) scene: Publisher<Ipc, [u32], SceneHeader>,
    pub(super) commands: Subscriber<Ipc, Command, ()>,
    pub(super) uploads: Subscriber<Ipc, [u8], UploadHeader>,
}

fn failed(why: impl std::fmt::Debug) -> ServiceError {
    ServiceError(format!(
        "cannot use shared memory: {why:?}. Is another rt-core running under this instance name? Choose another with --instance"
    ))
}

macro_rules! publisher {
    ($factory:expr) => {
        $factory?
            .publisher_builder()
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(failed)?
    };
    ($factory:expr, slices of $length:expr, loans $loans:expr, kept $kept:expr) => {
        $factory?
            .publisher_builder()
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .initial_max_slice_len($length)
            .max_loaned_samples($loans)
            .override_sample_preallocation($kept)
            .create()
            .map_err(failed)?
    };
}

/// Slices that memory is taken for at once. iceoryx2 takes enough for every host to hold every slice that it may, which
/// for a large scene is hundreds of MB of locked memory; hosts hold the newest, and where they hold more it takes more.
const SNAPSHOTS_KEPT: usize = 4 * SNAPSHOTS_AHEAD;
const SCENES_KEPT: usize = 3;

impl Ports {
    /// Creates every port, for a scene of `word_count` words whose snapshots hold `snapshot_len` vertices and nodes.
    pub fn new(node: &Node<Ipc>, snapshot_len: usize, word_count: usize) -> Result<Self, ServiceError> {
        let snapshot_service = service::snapshots(node)?;
        Ok(Self {
            session: publisher!(service::session(node)),
            events: publisher!(service::events(node)),
            parameters: publisher!(service::parameters(node)),
            plan: publisher!(service::plan(node)),
            replies: publisher!(service::replies(node)),
            rehearsals: publisher!(service::rehearsals(node)),
            records: publisher!(service::records(node), slices of MAX_BATCH, loans 2, kept |all| all),
            snapshots: publisher!(Ok::<_, ServiceError>(&snapshot_service), slices of snapshot_len, loans 2 * SNAPSHOTS_AHEAD, kept |_| SNAPSHOTS_KEPT),
            snapshot_service,
            scene: publisher!(service::scene(node), slices of word_count, loans 2, kept |_| SCENES_KEPT),
            commands: service::commands(node)?
                .subscriber_builder()
                .buffer_size(64)
                .create()
                .map_err(failed)?,
            uploads: service::uploads(node)?.subscriber_builder().create().map_err(failed)?,
        })
    }

    /// Somebody takes snapshots.
    pub fn has_viewers(&self) -> bool {
        self.snapshot_service.dynamic_config().number_of_subscribers() > 0
    }

    /// Connects new hosts and drops those that have disconnected.
    pub fn update_connections(&self) {
        // A host that cannot be connected now is connected at the next pass.
        let _ = self.session.update_connections();
        let _ = self.events.update_connections();
        let _ = self.parameters.update_connections();
        let _ = self.plan.update_connections();
        let _ = self.replies.update_connections();
        let _ = self.rehearsals.update_connections();
        let _ = self.records.update_connections();
        let _ = self.snapshots.update_connections();
        let _ = self.scene.update_connections();
    }
}
