//! Takes what lies in each subscriber's queue, checked, and keeps what belongs to the present run of the core.

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

/// The newest of everything that the core says.
#[derive(Default)]
pub struct Latest {
    pub session: Option<Session>,
    pub scene: PerSession<Arc<SceneModel>>,
    pub snapshot: PerSession<Snapshot>,
    pub parameters: PerSession<ParametersInForce>,
    pub plan: PerSession<PlanInForce>,
    pub events: VecDeque<Event>,
    early_events: VecDeque<Event>,
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
        for event in std::mem::take(&mut self.early_events) {
            if event.session_id == id {
                self.put_event(event);
            }
        }
    }

    /// History may be delivered twice when the ports are made again.
    pub fn put_event(&mut self, event: Event) {
        let queue = if self.id() == Some(event.session_id) {
            &mut self.events
        } else {
            &mut self.early_events
        };
        let known = queue
            .back()
            .is_some_and(|last| last.session_id == event.session_id && last.sequence >= event.sequence);
        if !known {
            queue.push_back(event);
        }
        if queue.len() > EVENTS_KEPT {
            queue.pop_front();
        }
    }
}

impl Link {
    pub(super) fn receive(&mut self) {
        let Some(ports) = self.ports.take() else { return };
        self.receive_session(&ports);
        self.receive_scene(&ports);
        self.receive_snapshot(&ports);
        let id = self.latest.id();
        while let Ok(Some(sample)) = ports.parameters.receive() {
            let p = *sample.payload();
            match check::parameters(&p) {
                Ok(()) => self.latest.parameters.put(id, p.session_id, p),
                Err(_) => self.invalid_dropped += 1,
            }
        }
        while let Ok(Some(sample)) = ports.plan.receive() {
            let p = *sample.payload();
            match check::plan(&p) {
                Ok(()) => self.latest.plan.put(id, p.session_id, p),
                Err(_) => self.invalid_dropped += 1,
            }
        }
        while let Ok(Some(sample)) = ports.events.receive() {
            let event = *sample.payload();
            let finite = event.value.is_finite() && event.position_m.iter().all(|c| c.is_finite());
            if finite && EventKind::from_number(event.kind).is_some() {
                self.latest.put_event(event);
            } else {
                self.invalid_dropped += 1;
            }
        }
        // Before the replies: whoever has the reply to a rehearsal has its result.
        while let Ok(Some(sample)) = ports.rehearsals.receive() {
            let rehearsal = *sample.payload();
            match check::rehearsal(&rehearsal) {
                Ok(()) => self.take_rehearsal(rehearsal),
                Err(_) => self.invalid_dropped += 1,
            }
        }
        while let Ok(Some(sample)) = ports.replies.receive() {
            self.take_reply(sample.payload());
        }
        self.receive_records(&ports);
        self.ports = Some(ports);
    }

    fn receive_session(&mut self, ports: &Ports) {
        let mut newest = None;
        while let Ok(Some(sample)) = ports.session.receive() {
            let session = *sample.payload();
            if session.schema_version == SCHEMA_VERSION && session.period_ns > 0 {
                // Two publishers, a dead one and its successor, are not received in the order of time.
                if newest.is_none_or(|n: Session| n.time_ns <= session.time_ns) {
                    newest = Some(session);
                }
            } else {
                self.invalid_dropped += 1;
            }
        }
        let Some(session) = newest else { return };
        match &self.latest.session {
            Some(old) if old.session_id == session.session_id => self.latest.session = Some(session),
            Some(old) if old.started_ns > session.started_ns => {}
            _ => self.begin_session(session),
        }
    }

    fn receive_scene(&mut self, ports: &Ports) {
        while let Ok(Some(sample)) = ports.scene.receive() {
            let (header, words) = (*sample.user_header(), sample.payload());
            let Some(model) = SceneModel::of_words(&header, words) else {
                self.invalid_dropped += 1;
                continue;
            };
            self.latest
                .scene
                .put(self.latest.id(), header.session_id, Arc::new(model));
        }
    }

    fn receive_snapshot(&mut self, ports: &Ports) {
        let mut newest = None;
        while let Ok(Some(sample)) = ports.snapshots.receive() {
            newest = Some(sample);
        }
        let Some(sample) = newest else { return };
        let (header, vertices) = (*sample.user_header(), sample.payload());
        if check::snapshot(&header, vertices).is_err() {
            self.invalid_dropped += 1;
            return;
        }
        let (surface, inside) = vertices.split_at(header.vertex_count as usize);
        let places = |part: &[Vertex]| part.iter().map(|v| v.position_m).collect();
        let snapshot = Snapshot {
            header,
            positions_m: places(surface),
            displacements_m: places(inside),
        };
        self.latest.snapshot.put(self.latest.id(), header.session_id, snapshot);
    }

    fn receive_records(&mut self, ports: &Ports) {
        let id = self.latest.id();
        while let Ok(Some(sample)) = ports.records.receive() {
            for record in sample.payload() {
                match check::record(record) {
                    Ok(()) if id == Some(record.session_id) => self.records.push(*record),
                    Ok(()) => {}
                    Err(_) => self.invalid_dropped += 1,
                }
            }
        }
        // A host that never takes them must not grow.
        if self.records.len() > RECORDS_KEPT {
            self.records.drain(..self.records.len() - RECORDS_KEPT / 2);
        }
    }
}
