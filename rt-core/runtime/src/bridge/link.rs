//! The link to the hosts: announcements, events, records, and the answers to their requests.

use super::batches::Batches;
use super::ports::Ports;
use crate::rt::clock;
use crate::rt::exchange::Ticket;
use std::collections::HashMap;
use stylet_shm_schema::service::Node;
use stylet_shm_schema::{Event, EventKind, Refusal, Reply, Session, Text, TickRecord};

const ANNOUNCE_NS: u64 = 200_000_000;
const CLEAN_UP_NS: u64 = 1_000_000_000;

/// Numbers of a host and of its command.
pub type Asker = (u64, u64);

/// Everything that hosts hear.
pub struct Link {
    node: Node,
    pub ports: Ports,
    pub session: Session,
    /// Who waits for an answer, behind each ticket.
    waiting: HashMap<Ticket, Asker>,
    tickets: Ticket,
    events: u64,
    batches: Batches<TickRecord>,
    announced_ns: u64,
    cleaned_ns: u64,
}

/// The fields of an event that depend on its kind.
pub struct EventDetails<'a> {
    pub code: u32,
    pub value: f64,
    pub position_m: [f64; 3],
    pub tick: u64,
    pub time_ns: u64,
    pub text: &'a str,
}

impl EventDetails<'_> {
    /// Nothing but the time; seen by the bridge.
    pub fn now() -> Self {
        Self::at(0, clock::now_ns())
    }

    /// Nothing but the tick of the loop that saw it, and its time.
    pub fn at(tick: u64, time_ns: u64) -> Self {
        Self {
            code: 0,
            value: 0.0,
            position_m: [0.0; 3],
            tick,
            time_ns,
            text: "",
        }
    }
}

impl Link {
    pub fn new(node: Node, ports: Ports, session: Session) -> Self {
        Self {
            node,
            ports,
            session,
            waiting: HashMap::new(),
            tickets: 0,
            events: 0,
            batches: Batches::default(),
            announced_ns: 0,
            cleaned_ns: 0,
        }
    }

    /// Connects hosts, sends the heartbeat, and frees what hosts that died have left.
    pub fn announce(&mut self) {
        self.ports.connect();
        let now_ns = clock::now_ns();
        if now_ns - self.announced_ns >= ANNOUNCE_NS {
            self.announced_ns = now_ns;
            self.session.time_ns = now_ns;
            let _ = self.ports.session.send(self.session);
        }
        if now_ns - self.cleaned_ns >= CLEAN_UP_NS {
            self.cleaned_ns = now_ns;
            self.node.clean_up();
        }
    }

    /// The newest record of the force loop.
    pub fn newest_record(&self) -> Option<&TickRecord> {
        self.batches.newest()
    }

    /// Takes what the force loop has made and sends it in batches.
    pub fn send_records(&mut self, records: &mut rtrb::Consumer<TickRecord>) {
        self.batches.pass(records, &self.ports.records, self.session.session_id);
    }

    /// Whatever has not been sent yet.
    pub fn send_batch(&mut self) {
        self.batches.send(&self.ports.records, self.session.session_id);
    }

    pub fn event(&mut self, kind: EventKind, details: EventDetails<'_>) {
        self.events += 1;
        let _ = self.ports.events.send(Event {
            session_id: self.session.session_id,
            sequence: self.events,
            time_ns: details.time_ns,
            tick: details.tick,
            kind: kind as u32,
            code: details.code,
            value: details.value,
            position_m: details.position_m,
            text: Text::new(details.text),
        });
    }

    /// A ticket under which `asker` waits for its answer.
    pub fn ticket(&mut self, asker: Asker) -> Ticket {
        self.tickets += 1;
        self.waiting.insert(self.tickets, asker);
        self.tickets
    }

    /// Who waits behind `ticket`.
    pub fn asker(&self, ticket: Ticket) -> Option<Asker> {
        self.waiting.get(&ticket).copied()
    }

    /// `Ok` with the first tick that ran with the change.
    pub fn answer(&mut self, ticket: Ticket, result: Result<u64, &Refusal>) {
        if let Some(asker) = self.waiting.remove(&ticket) {
            self.reply(asker, result);
        }
    }

    pub fn reply(&self, asker: Asker, result: Result<u64, &Refusal>) {
        let reply = Reply::new(self.session.session_id, asker, result);
        let _ = self.ports.replies.send(reply);
    }

    /// A refusal before there was a ticket.
    pub fn refuse(&mut self, asker: Asker, refusal: &Refusal) {
        self.session.refused += 1;
        self.reply(asker, Err(refusal));
    }

    /// A refusal of a message that is invalid, which every host learns.
    pub fn refuse_invalid(&mut self, asker: Asker, refusal: &Refusal) {
        self.report_invalid(refusal);
        self.refuse(asker, refusal);
    }

    pub fn report_invalid(&mut self, refusal: &Refusal) {
        self.event(
            EventKind::InvalidRefused,
            EventDetails {
                text: &refusal.text,
                ..EventDetails::now()
            },
        );
    }
}
