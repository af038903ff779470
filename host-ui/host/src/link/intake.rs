//! Messages of a core, checked before they reach the inbox: through shared memory, or from a core in this process.

use super::inbox::Inbox;
use super::received::answer_of;
use super::{SceneModel, Snapshot};
use stylet_shm_schema::*;

/// A message of a core, as its bridge publishes it.
#[derive(Clone, Copy)]
pub enum Published<'a> {
    /// The run.
    Session(&'a Session),
    /// The latest tick.
    State(&'a HapticState),
    /// Successive ticks.
    Records(&'a [TickRecord]),
    /// An event.
    Event(&'a Event),
    /// The parameters in force.
    Parameters(&'a ParametersInForce),
    /// The plan in force.
    Plan(&'a PlanInForce),
    /// The result of a rehearsal, which comes before its reply.
    Rehearsal(&'a Rehearsal),
    /// The answer to a command.
    Reply(&'a Reply),
    /// A scene, with its words.
    Scene(&'a SceneHeader, &'a [u32]),
    /// The tissue, with its vertices.
    Snapshot(&'a SnapshotHeader, &'a [Vertex]),
}

/// Checks of a host: of one core, in all its runs.
pub struct Intake {
    host_id: u64,
    session: Option<Session>,
    /// The newest state, which tells deaf ports.
    #[cfg_attr(target_family = "wasm", expect(dead_code))]
    tick: u64,
    /// The newest record: a restarted bridge sends older ones again.
    record_tick: u64,
}

impl Intake {
    pub fn of(host_id: u64) -> Self {
        Self {
            host_id,
            session: None,
            tick: 0,
            record_tick: 0,
        }
    }

    /// The present run.
    #[cfg(not(target_family = "wasm"))]
    pub fn session(&self) -> Option<&Session> {
        self.session.as_ref()
    }

    /// Newest tick of the state, and of the records.
    #[cfg(not(target_family = "wasm"))]
    pub fn ticks(&self) -> [u64; 2] {
        [self.tick, self.record_tick]
    }

    /// Puts a message into the inbox, or counts it as invalid; returns whether it begins another run of the core.
    pub fn take(&mut self, inbox: &mut Inbox, message: Published<'_>) -> bool {
        let is_valid = match message {
            Published::Session(session) => return self.take_session(inbox, session),
            Published::Records(records) => {
                let invalid = records.iter().filter(|record| !self.take_record(inbox, record));
                let invalid = invalid.count() as u64;
                inbox.invalid_dropped += invalid;
                true
            }
            Published::State(state) => {
                let is_valid = check::state(state).is_ok();
                if is_valid {
                    self.tick = state.tick;
                    inbox.run.state = Some(*state);
                }
                is_valid
            }
            Published::Event(event) => {
                let is_finite = event.value.is_finite() && event.position_m.iter().all(|c| c.is_finite());
                let is_valid = is_finite && EventKind::from_number(event.kind).is_some();
                if is_valid {
                    inbox.put_event(*event);
                }
                is_valid
            }
            Published::Parameters(parameters) => {
                let is_valid = check::parameters(parameters).is_ok();
                if is_valid {
                    inbox.of(parameters.session_id).parameters = Some(*parameters);
                }
                is_valid
            }
            Published::Plan(plan) => {
                let is_valid = check::plan(plan).is_ok();
                if is_valid {
                    inbox.of(plan.session_id).plan = Some(*plan);
                }
                is_valid
            }
            Published::Rehearsal(rehearsal) => {
                let is_valid = check::rehearsal(rehearsal).is_ok();
                if is_valid && self.is_own(rehearsal.session_id, rehearsal.host_id) {
                    inbox.put_rehearsal(*rehearsal);
                }
                is_valid
            }
            Published::Reply(reply) => match answer_of(reply) {
                _ if !self.is_own(reply.session_id, reply.host_id) => true,
                Some(answer) => {
                    inbox.put_answer(reply.command_id, answer);
                    true
                }
                None => false,
            },
            Published::Scene(header, words) => {
                inbox.put_scene(SceneModel::of_words(header, words));
                true
            }
            Published::Snapshot(header, vertices) => {
                inbox.put_snapshot(Snapshot::of_vertices(header, vertices));
                true
            }
        };
        inbox.invalid_dropped += u64::from(!is_valid);
        false
    }

    fn is_own(&self, session_id: u64, host_id: u64) -> bool {
        let id = self.session.map(|s| s.session_id);
        (Some(session_id), host_id) == (id, self.host_id)
    }

    /// Returns whether a record is valid.
    fn take_record(&mut self, inbox: &mut Inbox, record: &TickRecord) -> bool {
        let id = self.session.map(|s| s.session_id);
        let is_valid = check::record(record).is_ok();
        if is_valid && id == Some(record.session_id) && record.tick > self.record_tick {
            self.record_tick = record.tick;
            inbox.put_record(*record);
        }
        is_valid
    }

    fn take_session(&mut self, inbox: &mut Inbox, session: &Session) -> bool {
        if !is_usable(session) {
            inbox.invalid_dropped += 1;
            return false;
        }
        let begins = match &self.session {
            Some(old) if old.session_id == session.session_id => false,
            Some(old) if old.started_ns > session.started_ns => return false,
            _ => true,
        };
        if begins {
            (self.tick, self.record_tick) = (0, 0);
            inbox.begin(*session);
        }
        inbox.run.session = Some(*session);
        self.session = Some(*session);
        begins
    }
}

/// Returns whether an announcement is of this version.
pub fn is_usable(session: &Session) -> bool {
    session.schema_version == SCHEMA_VERSION && session.period_ns > 0
}
