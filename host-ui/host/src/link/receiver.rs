//! The thread that owns every port of a host: it receives, however slow the host is, and sends the host's requests.
//!
//! iceoryx2's ports belong to one thread. The queue of records holds seconds of them ([`RECORD_BUFFER`]), and this
//! thread polls every two milliseconds.

use super::inbox::Inbox;
use super::intake::{Intake, Published, is_usable};
use super::outgoing::Outgoing;
use super::ports::Ports;
use super::renewals::Renewals;
use super::second::SecondEnds;
use super::thread::lock;
use super::{ABSENT_AFTER, Snapshot, UNANSWERED};
use std::sync::{Arc, Mutex, mpsc};
use stylet_ports::{self as service, Node, ServiceError, SlicePublisher, StateReader};
use stylet_shm_schema::*;
use web_time::{Duration, Instant};

const CLEAN_EVERY: Duration = Duration::from_secs(1);
const CLEAN_AFTER: Duration = Duration::from_millis(300);
/// Interval of the check that the ports belong to the present epoch.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Silence of state or records, while the core reports that it lives, after which the ports count as damaged.
const DEAF_AFTER: Duration = Duration::from_millis(1500);
const CONNECT_AGAIN_AFTER: Duration = Duration::from_millis(250);
const OPEN_BOARD_EVERY: Duration = Duration::from_millis(20);

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
    intake: Intake,
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
            intake: Intake::of(host_id),
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
        let node = match self.intake.session() {
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
        for (heard, tick) in self.heard.iter_mut().zip(self.intake.ticks()) {
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
        let scenes = ports.scenes();
        let inbox = &mut *lock(&self.inbox);
        while let Some(batch) = ports.records.receive() {
            self.intake.take(inbox, Published::Records(batch.values()));
        }
        while let Some(event) = ports.events.receive() {
            self.intake.take(inbox, Published::Event(&event));
        }
        // Before the replies: a host that has the reply to a rehearsal has its result.
        while let Some(rehearsal) = ports.rehearsals.receive() {
            self.intake.take(inbox, Published::Rehearsal(&rehearsal));
        }
        while let Some(reply) = ports.replies.receive() {
            self.intake.take(inbox, Published::Reply(&reply));
        }
        while let Some(parameters) = ports.parameters.receive() {
            self.intake.take(inbox, Published::Parameters(&parameters));
        }
        while let Some(plan) = ports.plan.receive() {
            self.intake.take(inbox, Published::Plan(&plan));
        }
        while let Some(relayed) = ports.relayed.receive() {
            inbox.of(relayed.session_id).relayed = Some(relayed);
        }
        while let Some(class) = ports.class.receive() {
            let run = inbox.of(class.session_id);
            run.class = Some((Instant::now(), Arc::new(class)));
        }
        for scene in scenes {
            inbox.put_scene(scene);
        }
        if let Some(snapshot) = snapshot {
            inbox.put_snapshot(snapshot);
        }
    }

    /// Takes the newest announcement: those of two publishers, a dead one and its successor, do not arrive in time order.
    fn receive_session(&mut self, ports: &Ports) {
        let sessions = std::iter::from_fn(|| ports.session.receive());
        let (usable, others): (Vec<_>, Vec<_>) = sessions.partition(is_usable);
        let inbox = &mut *lock(&self.inbox);
        inbox.invalid_dropped += others.len() as u64;
        let Some(newest) = usable.into_iter().max_by_key(|session| session.time_ns) else {
            return;
        };
        // Everything of an earlier run is dropped before anything of the new one is opened.
        if self.intake.take(inbox, Published::Session(&newest)) {
            (self.board, self.board_tried) = (None, None);
            self.second.close();
        }
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
        let Some(session) = self.intake.session() else { return };
        if self.board.is_none() && self.board_tried.is_none_or(|t| t.elapsed() >= OPEN_BOARD_EVERY) {
            self.board_tried = Some(Instant::now());
            self.board = StateReader::open(&ports.node, session.session_id).ok();
        }
        self.second.open(&ports.node, session);
        let Some(board) = &self.board else { return };
        let state = board.read();
        let inbox = &mut *lock(&self.inbox);
        inbox.invalid_dropped += self.second.receive(session.session_id, inbox);
        self.intake.take(inbox, Published::State(&state));
    }

    fn feel_pulse(&mut self) {
        if let Some(session) = self.intake.session() {
            let beat = (session.time_ns, self.intake.ticks()[0]);
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
