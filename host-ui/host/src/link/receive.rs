//! Filters received data: keeps what belongs to the present run of the core.

use super::inbox::Inbox;
use super::*;

/// A value of the present run; one of a run not announced yet waits for its announcement.
pub struct PerSession<T> {
    held: Option<T>,
    early: Option<(u64, T)>,
}

impl<T> Default for PerSession<T> {
    fn default() -> Self {
        Self {
            held: None,
            early: None,
        }
    }
}

impl<T> PerSession<T> {
    pub fn get(&self) -> Option<&T> {
        self.held.as_ref()
    }

    fn put(&mut self, current: Option<u64>, session_id: u64, value: T) {
        if current == Some(session_id) {
            self.held = Some(value);
        } else {
            self.early = Some((session_id, value));
        }
    }

    fn begin(&mut self, session_id: u64) {
        self.held = self
            .early
            .take()
            .and_then(|(id, value)| (id == session_id).then_some(value));
    }
}

/// The newest data of each kind from the core.
#[derive(Default)]
pub struct Latest {
    pub session: Option<Session>,
    pub scene: PerSession<Arc<SceneModel>>,
    pub snapshot: PerSession<Snapshot>,
    pub parameters: PerSession<ParametersInForce>,
    pub plan: PerSession<PlanInForce>,
    pub relayed: Option<Relayed>,
    /// The class, with its time of arrival.
    pub class: Option<(Instant, Box<Class>)>,
    pub events: VecDeque<Event>,
    early_events: VecDeque<Event>,
    /// Numbers missing among the events of this run.
    pub events_unseen: u64,
}

impl Latest {
    pub fn id(&self) -> Option<u64> {
        self.session.as_ref().map(|s| s.session_id)
    }

    pub fn begin(&mut self, session: Session) {
        let id = session.session_id;
        self.session = Some(session);
        self.scene.begin(id);
        self.snapshot.begin(id);
        self.parameters.begin(id);
        self.plan.begin(id);
        self.events.clear();
        self.events_unseen = 0;
        for event in std::mem::take(&mut self.early_events) {
            if event.session_id == id {
                self.put_event(event);
            }
        }
    }

    /// Adds an event. History may be delivered twice when the ports are recreated.
    pub fn put_event(&mut self, event: Event) {
        let is_current = self.id() == Some(event.session_id);
        let queue = match is_current {
            true => &mut self.events,
            false => &mut self.early_events,
        };
        let last = queue.back().filter(|last| last.session_id == event.session_id);
        if last.is_some_and(|last| last.sequence >= event.sequence) {
            return;
        }
        if let Some(last) = last.filter(|_| is_current) {
            self.events_unseen += event.sequence - last.sequence - 1;
        }
        queue.push_back(event);
        if queue.len() > EVENTS_KEPT {
            queue.pop_front();
        }
    }
}

impl Link {
    pub(super) fn take(&mut self, inbox: Inbox) {
        self.pulse = inbox.pulse;
        self.invalid_dropped += inbox.invalid_dropped;
        if let Some(session) = inbox.session {
            match &mut self.latest.session {
                Some(held) if held.session_id == session.session_id => *held = session,
                _ => self.begin_session(session),
            }
        }
        let id = self.latest.id();
        if let Some((session_id, scene)) = inbox.scene {
            self.latest.scene.put(id, session_id, scene);
        }
        if let Some(snapshot) = inbox.snapshot {
            self.latest.snapshot.put(id, snapshot.header.session_id, snapshot);
        }
        if let Some(p) = inbox.parameters {
            self.latest.parameters.put(id, p.session_id, p);
        }
        self.latest.relayed = inbox.relayed.or(self.latest.relayed);
        self.latest.class = inbox.class.or(self.latest.class.take());
        if let Some(p) = inbox.plan {
            self.latest.plan.put(id, p.session_id, p);
        }
        if inbox.state.is_some() {
            self.state = inbox.state;
        }
        inbox.events.into_iter().for_each(|event| self.latest.put_event(event));
        inbox.rehearsals.into_iter().for_each(|r| self.take_rehearsal(r));
        inbox.replies.iter().for_each(|reply| self.take_reply(reply));
        for (id, why) in inbox.unsent {
            self.put_answer(id, Answer::unsent(why));
        }
        self.second_state = inbox.second_state.or(self.second_state);
        self.latest.events.iter().for_each(|event| self.motions.take(event));
        let is_moving = |tick: u64, flags: u32| (tick, flags & flags::IN_MOTION != 0);
        self.motions.seen([
            self.state.map(|s| is_moving(s.tick, s.flags)),
            self.second_state.map(|s| is_moving(s.tick, s.flags)),
        ]);
        join(&mut self.records, inbox.records);
        join(&mut self.second_records, inbox.second_records);
    }

    fn begin_session(&mut self, session: Session) {
        self.state = None;
        self.motions.forget();
        self.answers.clear();
        self.rehearsals.clear();
        self.records.clear();
        self.second_state = None;
        self.second_records.clear();
        self.latest.begin(session);
    }

    fn take_rehearsal(&mut self, rehearsal: Box<Rehearsal>) {
        if self.latest.id() != Some(rehearsal.session_id) {
            return;
        }
        self.rehearsals.insert(rehearsal.command_id, rehearsal);
        if self.rehearsals.len() > REHEARSALS_KEPT {
            self.rehearsals.pop_first();
        }
    }

    fn take_reply(&mut self, reply: &Reply) {
        if self.latest.id() != Some(reply.session_id) {
            return;
        }
        match Answer::of_reply(reply) {
            Some(answer) => self.put_answer(reply.command_id, answer),
            None => self.invalid_dropped += 1,
        }
    }

    fn put_answer(&mut self, command_id: u64, answer: Answer) {
        if command_id == UNANSWERED {
            return;
        }
        self.motions.answered(command_id, &answer);
        self.answers.insert(command_id, answer);
        if self.answers.len() > ANSWERS_KEPT {
            self.answers.pop_first();
        }
    }
}

/// Appends records in bounded memory, in case a host never takes them.
fn join<T>(held: &mut VecDeque<T>, new: VecDeque<T>) {
    match held.is_empty() {
        true => *held = new,
        false => held.extend(new),
    }
    let beyond = held.len().saturating_sub(RECORDS_KEPT);
    held.drain(..beyond);
}
