//! Every port that a host holds, made together and dropped together.

use super::SceneModel;
use stylet_ports::{self as service, Node, Publisher, ServiceError, SliceSubscriber, Subscriber};
use stylet_shm_schema::*;

// Ports precede the node, so that they are dropped first.
pub struct Ports {
    pub session: Subscriber<Session>,
    pub events: Subscriber<Event>,
    pub parameters: Subscriber<ParametersInForce>,
    pub plan: Subscriber<PlanInForce>,
    pub replies: Subscriber<Reply>,
    pub rehearsals: Subscriber<Rehearsal>,
    pub relayed: Subscriber<Relayed>,
    pub class: Subscriber<Class>,
    pub lease: Publisher<LeaseOrder>,
    pub records: SliceSubscriber<TickRecord, u64>,
    pub snapshots: SliceSubscriber<Vertex, SnapshotHeader>,
    pub scene: SliceSubscriber<u32, SceneHeader>,
    pub commands: Publisher<Command>,
    pub stops: Publisher<Command>,
    pub node: Node,
}

impl Ports {
    pub fn new(node: Node) -> Result<Self, ServiceError> {
        Ok(Self {
            session: service::session::subscriber(&node)?,
            events: service::events::subscriber(&node)?,
            parameters: service::parameters::subscriber(&node)?,
            plan: service::plan::subscriber(&node)?,
            replies: service::replies::subscriber(&node)?,
            rehearsals: service::rehearsals::subscriber(&node)?,
            relayed: service::relayed::subscriber(&node)?,
            class: service::class::subscriber(&node)?,
            lease: service::lease::publisher(&node)?,
            records: service::records::subscriber(&node)?,
            snapshots: service::snapshots::subscriber(&node)?,
            scene: service::scene::subscriber(&node)?,
            commands: service::commands::publisher(&node)?,
            stops: service::stops::publisher(&node)?,
            node,
        })
    }

    /// Returns each scene that arrived; `None` for an inconsistent one.
    pub fn scenes(&self) -> Vec<Option<SceneModel>> {
        std::iter::from_fn(|| self.scene.receive())
            .map(|sample| SceneModel::of_words(sample.header(), sample.values()))
            .collect()
    }
}
