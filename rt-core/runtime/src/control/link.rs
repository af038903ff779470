//! The link to the hosts: announcements, events, records, and the answers to their requests.

use super::answers::{Answers, Asker};
use super::wall::Wall;
use crate::rt::exchange::Ticket;
use stylet_shm_schema::{Event, EventKind, Refusal, Reply, Session, Text, TickRecord};
use stylet_wall::kind::Kind;

const ANNOUNCE_NS: u64 = 200_000_000;

/// Everything sent to the hosts.
pub struct Link {
    pub wall: Box<dyn Wall>,
    pub session: Session,
    pub answers: Answers,
    events: u64,
    announced_ns: u64,
    /// Why the bridge was last lost, until it is replaced.
    bridge_lost: Option<String>,
}

/// Returns an event that a loop saw at `tick`.
pub fn event_at(kind: EventKind, tick: u64, time_ns: u64) -> Event {
    Event {
        tick,
        time_ns,
        kind: kind as u32,
        ..bytemuck::Zeroable::zeroed()
    }
}

impl Link {
    pub fn new(wall: Box<dyn Wall>, session: Session) -> Self {
        Self {
            wall,
            session,
            answers: Answers::default(),
            events: 0,
            announced_ns: 0,
            bridge_lost: None,
        }
    }

    /// Returns an event that the control thread saw just now.
    pub fn event_now(&self, kind: EventKind) -> Event {
        event_at(kind, 0, self.wall.now_ns())
    }

    /// Serves the control thread and sends the heartbeat.
    pub fn announce(&mut self) {
        self.wall.pass();
        // A bridge that keeps failing for one reason is reported once: otherwise it would displace all other events.
        let lost = self.wall.take_lost();
        if let Some(why) = lost.filter(|why| self.bridge_lost.as_ref() != Some(why)) {
            self.bridge_lost = Some(why.clone());
            eprintln!("rt-core: the bridge to the hosts is started anew: {why}");
            self.event(Event {
                text: Text::new(&why),
                ..self.event_now(EventKind::BridgeRestarted)
            });
        }
        if self.wall.is_open() {
            self.bridge_lost = None;
        }
        let now_ns = self.wall.now_ns();
        if now_ns - self.announced_ns >= ANNOUNCE_NS {
            self.announced_ns = now_ns;
            self.session.time_ns = now_ns;
            // Its count of refusals includes those of the bridge.
            let refused = self.session.refused + self.wall.refused();
            let session = Session {
                refused,
                ..self.session
            };
            self.wall.keep(Kind::Session, &session);
        }
    }

    /// Returns the newest record of the force loop.
    pub fn newest_record(&self) -> Option<&TickRecord> {
        self.wall.newest_record()
    }

    /// Takes the force loop's records and sends them in batches.
    pub fn send_records(&mut self, records: &mut rtrb::Consumer<TickRecord>) {
        self.wall.take_records(records);
    }

    /// Sends an event of this run.
    pub fn event(&mut self, event: Event) {
        self.events += 1;
        self.wall.keep(
            Kind::Event,
            &Event {
                session_id: self.session.session_id,
                sequence: self.events,
                ..event
            },
        );
    }

    /// Answers a request with the first force-loop tick that used the change, or with a refusal.
    pub fn answer(&mut self, ticket: Ticket, result: Result<u64, &Refusal>) {
        match result {
            Ok(tick) => {
                self.answers.holds_from(ticket, tick);
                self.carried_out(ticket, tick);
            }
            Err(_) => {
                if let Some(asker) = self.answers.refused(ticket) {
                    self.reply(asker, result);
                }
            }
        }
    }

    /// Records that the tissue loop or the second device's loop carried out a request.
    pub fn carried_out(&mut self, ticket: Ticket, tick: u64) {
        if let Some((asker, tick)) = self.answers.carried_out(ticket, tick) {
            self.reply(asker, Ok(tick));
        }
    }

    pub fn reply(&mut self, asker: Asker, result: Result<u64, &Refusal>) {
        let reply = Reply::new(self.session.session_id, asker, result);
        self.wall.keep(Kind::Reply, &reply);
    }

    /// Refuses a request that has no ticket yet.
    pub fn refuse(&mut self, asker: Asker, refusal: &Refusal) {
        self.session.refused += 1;
        self.reply(asker, Err(refusal));
    }

    /// Refuses an invalid message and reports it to every host.
    pub fn refuse_invalid(&mut self, asker: Asker, refusal: &Refusal) {
        self.report_invalid(refusal);
        self.refuse(asker, refusal);
    }

    pub fn report_invalid(&mut self, refusal: &Refusal) {
        self.event(Event {
            text: Text::new(&refusal.text),
            ..self.event_now(EventKind::InvalidRefused)
        });
    }
}
