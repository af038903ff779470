//! Publications of the core except state, records and snapshots: sent to all as they arrive, and to a new member in
//! full.

use super::{Server, lock};
use crate::class::ClassPorts;
use crate::net::Bytes;
use crate::ports::Near;
use crate::wire::{Hello, Kind, class_bytes, encode};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};
use stylet_ports::Node;
use stylet_shm_schema::affinity::Left;
use stylet_shm_schema::{Class, Event, ParametersInForce, PlanInForce, Reply, SCHEMA_VERSION, Session, check};

const OPEN_EVERY: Duration = Duration::from_millis(20);
/// Silence after which the ports are recreated: another core may have swept their folder.
const CLEAN_EVERY: Duration = Duration::from_secs(1);
const EVENTS_KEPT: usize = 64;
const REPLIES_KEPT: usize = 32;

/// The ports, and the state in force.
pub struct Announcements {
    server: Arc<Server>,
    // The ports before their node.
    class: Option<ClassPorts>,
    near: Option<Near>,
    tried: Option<Instant>,
    heard: Instant,
    cleaned: Instant,
    left_core: Left,
    session: Option<Session>,
    parameters: Option<ParametersInForce>,
    plan: Option<PlanInForce>,
    /// Identity and message of the scene.
    scene: Option<((u64, u64), Bytes)>,
    events: VecDeque<Event>,
    replies: VecDeque<Reply>,
}

impl Announcements {
    pub fn new(server: Arc<Server>) -> Self {
        let now = Instant::now();
        Self {
            server,
            class: None,
            near: None,
            tried: None,
            heard: now,
            cleaned: now,
            left_core: Left::default(),
            session: None,
            parameters: None,
            plan: None,
            scene: None,
            events: VecDeque::new(),
            replies: VecDeque::new(),
        }
    }

    /// Returns the ports to the core, if any.
    pub fn near(&self) -> Option<&Near> {
        self.near.as_ref()
    }

    /// Returns the ports of the class for hosts next to the core, if any.
    pub fn class(&self) -> Option<&ClassPorts> {
        self.class.as_ref()
    }

    /// Sends the class to all members and to hosts next to the core.
    pub fn show(&self, class: Class) {
        self.send(Kind::Class, &[class_bytes(&class)]);
        if let Some(ports) = &self.class {
            ports.connect();
            ports.show(Class {
                session_id: self.session_id(),
                is_beside_core: 1,
                ..class
            });
        }
    }

    /// The run of the core.
    pub fn session_id(&self) -> u64 {
        self.session.map_or(0, |session| session.session_id)
    }

    fn message(&self, kind: Kind, parts: &[&[u8]]) -> Vec<u8> {
        encode(kind, self.server.stamp(), parts)
    }

    /// Sends a message to all.
    pub fn send(&self, kind: Kind, parts: &[&[u8]]) {
        self.server.to_all(self.message(kind, parts));
    }

    pub fn pass(&mut self) {
        self.open();
        if let Some(near) = self.near.take() {
            self.receive(&near);
            if self.heard.elapsed() > CLEAN_EVERY && self.cleaned.elapsed() > CLEAN_EVERY {
                self.cleaned = Instant::now();
                near.node.clean_up();
            }
            self.near = Some(near);
        }
    }

    fn open(&mut self) {
        let now = Instant::now();
        if self.tried.is_some_and(|tried| now - tried < OPEN_EVERY) {
            return;
        }
        self.tried = Some(now);
        if self.near.as_ref().is_some_and(|near| !near.node.is_current()) {
            (self.class, self.near) = (None, None);
        }
        if self.near.is_none() {
            let node = match self.session {
                Some(_) => Node::join_again(&self.server.instance),
                None => Node::join(&self.server.instance),
            };
            self.near = node.and_then(Near::new).ok();
            self.class = self.near.as_ref().and_then(|near| ClassPorts::new(&near.node).ok());
        }
    }

    fn receive(&mut self, near: &Near) {
        while let Some(session) = near.session.receive() {
            let is_older = self.session.is_some_and(|old| old.started_ns > session.started_ns);
            if session.schema_version != SCHEMA_VERSION || is_older {
                continue;
            }
            if self.session.is_none_or(|old| old.session_id != session.session_id) {
                self.events.clear();
                self.replies.clear();
            }
            (self.session, self.heard) = (Some(session), Instant::now());
            self.left_core.leave(&session);
            self.send(Kind::Session, &[bytemuck::bytes_of(&session)]);
        }
        while let Some(sample) = near.parameters.receive() {
            self.parameters = Some(sample);
            self.send(Kind::Parameters, &[bytemuck::bytes_of(&sample)]);
        }
        while let Some(sample) = near.plan.receive() {
            self.plan = Some(sample);
            self.send(Kind::Plan, &[bytemuck::bytes_of(&sample)]);
        }
        while let Some(sample) = near.scene.receive() {
            let header = *sample.header();
            if check::scene(&header, sample.values()).is_ok() {
                let parts = [bytemuck::bytes_of(&header), bytemuck::cast_slice(sample.values())];
                let bytes = Bytes::from(self.message(Kind::Scene, &parts));
                let id = (header.session_id, header.generation);
                let now = Instant::now();
                (lock(&self.server.outlets).values_mut()).for_each(|outlet| outlet.scene(id, &bytes, now));
                self.scene = Some((id, bytes));
            }
        }
        while let Some(event) = near.events.receive() {
            self.events.push_back(event);
            self.events.drain(..self.events.len().saturating_sub(EVENTS_KEPT));
            self.send(Kind::Event, &[bytemuck::bytes_of(&event)]);
        }
        // Before the replies: a host that has the reply to a rehearsal has its result.
        while let Some(sample) = near.rehearsals.receive() {
            self.send(Kind::Rehearsal, &[bytemuck::bytes_of(&sample)]);
        }
        while let Some(reply) = near.replies.receive() {
            self.replies.push_back(reply);
            self.replies.drain(..self.replies.len().saturating_sub(REPLIES_KEPT));
            self.send(Kind::Reply, &[bytemuck::bytes_of(&reply)]);
        }
    }

    /// True if the member has the scene in force, or there is none.
    pub fn has_scene(&self, hello: &Hello) -> bool {
        let theirs = (hello.scene_session, hello.scene_generation);
        self.scene.as_ref().is_none_or(|(id, _)| *id == theirs)
    }

    /// Sends the scene in force to a member that reports another.
    pub fn send_scene(&self, seat: u16, now: Instant) {
        if let (Some((id, bytes)), Some(outlet)) = (&self.scene, lock(&self.server.outlets).get_mut(&seat)) {
            outlet.scene(*id, bytes, now);
        }
    }

    /// Sends the state in force, except the scene, to a member that has just joined or was cut off.
    pub fn greet(&self, seat: u16) {
        let outlets = lock(&self.server.outlets);
        let Some(outlet) = outlets.get(&seat) else { return };
        let send = |kind, parts: &[&[u8]]| outlet.message(self.message(kind, parts).into());
        if let Some(session) = &self.session {
            send(Kind::Session, &[bytemuck::bytes_of(session)]);
        }
        if let Some(parameters) = &self.parameters {
            send(Kind::Parameters, &[bytemuck::bytes_of(parameters)]);
        }
        if let Some(plan) = &self.plan {
            send(Kind::Plan, &[bytemuck::bytes_of(plan)]);
        }
        for event in &self.events {
            send(Kind::Event, &[bytemuck::bytes_of(event)]);
        }
        for reply in &self.replies {
            send(Kind::Reply, &[bytemuck::bytes_of(reply)]);
        }
    }
}
