//! The thread that owns every port of a host: it receives, however slow the host is, and sends the host's requests.
//!
//! iceoryx2's ports belong to one thread. The queue of records holds seconds of them ([`RECORD_BUFFER`]), and this
//! thread polls every two milliseconds.

use super::inbox::Inbox;
use super::motion::Renewals;
use super::ports::Ports;
use super::received::answer_of;
use super::second::SecondEnds;
use super::thread::lock;
use super::{ABSENT_AFTER, Snapshot, UNANSWERED};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};
use stylet_ports::{self as service, Node, ServiceError, SlicePublisher, StateReader};
use stylet_shm_schema::*;

const CLEAN_EVERY: Duration = Duration::from_secs(1);
const CLEAN_AFTER: Duration = Duration::from_millis(300);
/// Interval of the check that the ports belong to the present epoch.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Silence of state or records, while the core reports that it lives, after which the ports count as damaged.
const DEAF_AFTER: Duration = Duration::from_millis(1500);
const CONNECT_AGAIN_AFTER: Duration = Duration::from_millis(250);
const OPEN_BOARD_EVERY: Duration = Duration::from_millis(20);

/// A message of the host to the core.
pub enum Outgoing {
    Command(Box<Command>),
    /// This host's motions continue until then, as long as this process runs.
    Promise(Instant),
    Upload(Box<UploadHeader>, Vec<u8>),
    Lease(LeaseOrder),
}

/// The thread's side: one pass over all ports at a time.
pub struct Passes {
    // Dropped in this order: handles before the ports, and those before their node.
    board: Option<StateReader>,
    second: SecondEnds,
    upload_port: Option<SlicePublisher<u8, UploadHeader>>,
    ports: Option<Ports>,
    instance: Instance,
    host_id: u64,
    inbox: Arc<Mutex<Inbox>>,
    asked: mpsc::Receiver<Outgoing>,
    renewals: Renewals,
    session: Option<Session>,
    tick: u64,
    /// The newest record: a restarted bridge sends older ones again.
    record_tick: u64,
    looked: Option<Instant>,
    /// When state and records last advanced, or the ports were made.
    heard: [(u64, Instant); 2],
    connect_failed: Option<Instant>,
    /// Time since which ports cannot be made although a core is running.
    failing: Option<Instant>,
    board_tried: Option<Instant>,
    snapshots_every: Duration,
    snapshot_taken: Option<Instant>,
    cleaned: Instant,
    beat: Option<(u64, u64)>,
    beat_moved: Option<Instant>,
}

impl Passes {
    pub fn new(
        (instance, host_id): (Instance, u64),
        snapshots_every: Duration,
        inbox: Arc<Mutex<Inbox>>,
        asked: mpsc::Receiver<Outgoing>,
    ) -> Self {
        Self {
            board: None,
            second: SecondEnds::default(),
            upload_port: None,
            ports: None,
            instance,
            host_id,
            inbox,
            asked,
            renewals: Renewals::default(),
            session: None,
            tick: 0,
            record_tick: 0,
            looked: None,
            heard: [(0, Instant::now()); 2],
            connect_failed: None,
            failing: None,
            board_tried: None,
            snapshots_every,
            snapshot_taken: None,
            cleaned: Instant::now(),
            beat: None,
            beat_moved: None,
        }
    }

    pub fn pass(&mut self) {
        self.send();
        if let Some(ports) = self.ports.take() {
            self.receive(&ports);
            self.read_board(&ports);
            self.ports = Some(ports);
        }
        self.feel_pulse();
        self.tidy();
        // Last: after a pause of this thread the ports seem deaf until their queues are read, and new ones have none.
        self.connect();
    }

    /// Drops the ports of a past epoch, and makes those of the present one.
    fn connect(&mut self) {
        let now = Instant::now();
        let long_ago = |then: Option<Instant>, every| then.is_none_or(|t: Instant| now - t >= every);
        if !long_ago(self.looked, LOOK_EVERY) {
            return;
        }
        self.looked = Some(now);
        if self.ports.as_ref().is_some_and(|ports| !ports.node.is_current()) {
            self.second.close_ports();
            (self.board, self.board_tried, self.upload_port, self.ports) = (None, None, None, None);
        }
        self.complain(now);
        if self.ports.is_some() || !long_ago(self.connect_failed, CONNECT_AGAIN_AFTER) {
            return;
        }
        let node = match self.session {
            Some(_) => Node::join_again(&self.instance),
            None => Node::join(&self.instance),
        };
        let trouble = match node.and_then(Ports::new) {
            Ok(ports) => {
                self.ports = Some(ports);
                (self.heard, self.failing) = ([(0, now); 2], None);
                None
            }
            Err(ServiceError::Absent(_)) => {
                self.failing = None;
                None
            }
            Err(why) => {
                self.connect_failed = Some(now);
                let is_damaged = matches!(why, ServiceError::Port { .. });
                let since = *self.failing.get_or_insert(now);
                if is_damaged && now - since > DEAF_AFTER {
                    self.failing = None;
                    if let Some(epoch) = self.instance.epoch() {
                        epoch.complain();
                    }
                }
                Some(why.to_string())
            }
        };
        lock(&self.inbox).pulse.trouble = trouble;
    }

    /// Complains about damaged ports. Their owner cannot see damage that a host sees, and recreates all of them on a
    /// complaint.
    fn complain(&mut self, now: Instant) {
        let Some(ports) = &self.ports else { return };
        for (heard, tick) in self.heard.iter_mut().zip([self.tick, self.record_tick]) {
            if heard.0 != tick {
                *heard = (tick, now);
            }
        }
        if self.heard.iter().any(|(_, then)| now - *then > DEAF_AFTER) {
            ports.node.epoch().complain();
            self.heard = [(0, now); 2];
        }
    }

    fn send(&mut self) {
        while let Ok(outgoing) = self.asked.try_recv() {
            let (id, sent) = match outgoing {
                Outgoing::Command(command) => (command.command_id, self.send_command(&command)),
                Outgoing::Upload(header, cells) => (header.command_id, self.send_volume(&header, &cells)),
                Outgoing::Promise(until) => {
                    self.renewals.promise(until);
                    continue;
                }
                Outgoing::Lease(order) => {
                    // The class list shows the result, and disappears without a relay.
                    let _ = self.ports.as_ref().map(|ports| ports.lease.send(order));
                    continue;
                }
            };
            if let Err(text) = sent {
                let reasons = Vec::new();
                lock(&self.inbox).put_answer(id, Err(Refusal { reasons, text }));
            }
        }
        let renewal = self.renewals.due(Instant::now());
        if let Some(Ok(command)) = renewal.map(|request| request.encode(self.host_id, UNANSWERED)) {
            // Without it the hand brakes: a full queue is no error.
            let _sent = self.send_command(&command);
        }
    }

    fn send_command(&self, command: &Command) -> Result<(), String> {
        let ports = self.ports.as_ref().ok_or("there is no connection to rt-core")?;
        if CommandKind::is_stop(command.kind) {
            // Sent both ways: this one passes every flood, the other keeps its order among earlier requests.
            let _ = ports.stops.send(*command);
        }
        match ports.commands.send(*command) {
            Ok(0) => Err("the core did not accept the command: its queue is full or it has just ended".to_owned()),
            Ok(_) => Ok(()),
            Err(e) => Err(format!("the command could not be sent: {e}")),
        }
    }

    fn send_volume(&mut self, header: &UploadHeader, cells: &[u8]) -> Result<(), String> {
        self.upload_port = None;
        let ports = self.ports.as_ref().ok_or("there is no connection to rt-core")?;
        let port = service::uploads::publisher(&ports.node, cells.len()).map_err(|e| e.to_string())?;
        let taken = port.send(header, cells);
        // The core still has to map the port's memory.
        self.upload_port = Some(port);
        match taken {
            Ok(0) => Err(format!(
                "the core did not accept the volume; at most {MAX_HOSTS} hosts can be connected"
            )),
            Ok(_) => Ok(()),
            Err(e) => Err(format!("the volume of {} cells could not be sent: {e}", cells.len())),
        }
    }

    /// Receives numbered data first: its queues drop the oldest.
    fn receive(&mut self, ports: &Ports) {
        self.receive_session(ports);
        let snapshot = self.receive_snapshot(ports);
        let scene = ports.scenes();
        let id = self.session.map(|s| s.session_id);
        let mut invalid = 0;
        let inbox = &mut *lock(&self.inbox);
        while let Some(batch) = ports.records.receive() {
            for record in batch.values() {
                match check::record(record) {
                    Ok(()) if id == Some(record.session_id) && record.tick > self.record_tick => {
                        self.record_tick = record.tick;
                        inbox.put_record(*record);
                    }
                    Ok(()) => {}
                    Err(_) => invalid += 1,
                }
            }
        }
        let is_event = |event: &Event| {
            let finite = event.value.is_finite() && event.position_m.iter().all(|c| c.is_finite());
            finite && EventKind::from_number(event.kind).is_some()
        };
        for event in valid(|| ports.events.receive(), is_event, &mut invalid) {
            inbox.put_event(event);
        }
        // Before the replies: a host that has the reply to a rehearsal has its result.
        let is_own = |session_id: u64, host_id: u64| (Some(session_id), host_id) == (id, self.host_id);
        for rehearsal in valid(
            || ports.rehearsals.receive(),
            |r| check::rehearsal(r).is_ok(),
            &mut invalid,
        ) {
            if is_own(rehearsal.session_id, rehearsal.host_id) {
                inbox.put_rehearsal(rehearsal);
            }
        }
        while let Some(reply) = ports.replies.receive() {
            match answer_of(&reply) {
                _ if !is_own(reply.session_id, reply.host_id) => {}
                Some(answer) => inbox.put_answer(reply.command_id, answer),
                None => invalid += 1,
            }
        }
        for p in valid(
            || ports.parameters.receive(),
            |p| check::parameters(p).is_ok(),
            &mut invalid,
        ) {
            inbox.of(p.session_id).parameters = Some(p);
        }
        for plan in valid(|| ports.plan.receive(), |p| check::plan(p).is_ok(), &mut invalid) {
            inbox.of(plan.session_id).plan = Some(plan);
        }
        while let Some(relayed) = ports.relayed.receive() {
            inbox.of(relayed.session_id).relayed = Some(relayed);
        }
        while let Some(class) = ports.class.receive() {
            let run = inbox.of(class.session_id);
            run.class = Some((Instant::now(), Arc::new(class)));
        }
        let inconsistent = scene.iter().filter(|scene| scene.is_none()).count();
        invalid += inconsistent as u64 + u64::from(matches!(snapshot, Some(None)));
        for scene in scene.into_iter().flatten() {
            let run = inbox.of(scene.header.session_id);
            run.scene = Some(Arc::new(scene));
        }
        if let Some(snapshot) = snapshot.flatten() {
            let run = inbox.of(snapshot.header.session_id);
            run.snapshot = Some(Arc::new(snapshot));
        }
        inbox.invalid_dropped += invalid;
    }

    fn receive_session(&mut self, ports: &Ports) {
        let mut newest = None;
        while let Some(session) = ports.session.receive() {
            if session.schema_version == SCHEMA_VERSION && session.period_ns > 0 {
                // Messages of two publishers, a dead one and its successor, do not arrive in time order.
                if newest.is_none_or(|n: Session| n.time_ns <= session.time_ns) {
                    newest = Some(session);
                }
            } else {
                lock(&self.inbox).invalid_dropped += 1;
            }
        }
        let Some(session) = newest else { return };
        match &self.session {
            Some(old) if old.session_id == session.session_id => lock(&self.inbox).run.session = Some(session),
            Some(old) if old.started_ns > session.started_ns => return,
            // Everything of an earlier run is dropped before anything of the new one is opened.
            _ => {
                (self.board, self.board_tried, self.tick, self.record_tick) = (None, None, 0, 0);
                self.second.close();
                lock(&self.inbox).begin(session);
            }
        }
        self.session = Some(session);
    }

    /// Returns the newest snapshot; the inner `None` marks an inconsistent one.
    fn receive_snapshot(&mut self, ports: &Ports) -> Option<Option<Snapshot>> {
        if self.snapshot_taken.is_some_and(|t| t.elapsed() < self.snapshots_every) {
            return None;
        }
        let mut newest = None;
        while let Some(sample) = ports.snapshots.receive() {
            newest = Some(sample);
        }
        let sample = newest?;
        self.snapshot_taken = Some(Instant::now());
        Some(Snapshot::of_vertices(sample.header(), sample.values()))
    }

    fn read_board(&mut self, ports: &Ports) {
        let Some(session) = &self.session else { return };
        if self.board.is_none() && self.board_tried.is_none_or(|t| t.elapsed() >= OPEN_BOARD_EVERY) {
            self.board_tried = Some(Instant::now());
            self.board = StateReader::open(&ports.node, session.session_id).ok();
        }
        self.second.open(&ports.node, session);
        let Some(board) = &self.board else { return };
        let state = board.read();
        let inbox = &mut *lock(&self.inbox);
        inbox.invalid_dropped += self.second.receive(session.session_id, inbox);
        match check::state(&state) {
            Ok(()) => {
                self.tick = state.tick;
                inbox.run.state = Some(state);
            }
            Err(_) => inbox.invalid_dropped += 1,
        }
    }

    fn feel_pulse(&mut self) {
        if let Some(session) = &self.session {
            let beat = (session.time_ns, self.tick);
            if self.beat != Some(beat) {
                self.beat = Some(beat);
                self.beat_moved = Some(Instant::now());
            }
        }
        let pulse = &mut lock(&self.inbox).pulse;
        (pulse.moved, pulse.has_board) = (self.beat_moved, self.board.is_some());
        pulse.looked = Some(Instant::now());
    }

    /// Removes the remains of a dead core: no other process does so in the background.
    fn tidy(&mut self) {
        let silent = self.beat_moved.map_or(ABSENT_AFTER, |t| t.elapsed());
        if silent >= ABSENT_AFTER {
            (self.board, self.upload_port) = (None, None);
            self.second.close();
        }
        if silent > CLEAN_AFTER && self.cleaned.elapsed() >= CLEAN_EVERY {
            self.cleaned = Instant::now();
            if let Some(ports) = &self.ports {
                ports.node.clean_up();
            }
        }
    }
}

/// Returns the valid ones of all that arrived; counts the others.
fn valid<T>(receive: impl FnMut() -> Option<T>, is_valid: impl Fn(&T) -> bool, invalid: &mut u64) -> Vec<T> {
    let (valid, others): (Vec<T>, Vec<T>) = std::iter::from_fn(receive).partition(is_valid);
    *invalid += others.len() as u64;
    valid
}
