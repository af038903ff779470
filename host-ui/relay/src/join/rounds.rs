//! Passes of a member: the state in force goes to hosts here, their requests go to the server.

use super::awaited::Awaited;
use super::line::Line;
use super::streams::Scenes;
use super::volume::Volume;
use super::{Member, Options, SILENCE};
use crate::control::{Order, Orders};
use crate::ports::Far;
use crate::say::say;
use crate::wire::{self, Hello, Kind, Rest};
use crate::{RelayError, now_ns};
use bytemuck::Zeroable;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use stylet_ports::StateWriter;
use stylet_shm_schema::affinity::Left;
use stylet_shm_schema::check::{self, Invalid};
use stylet_shm_schema::{
    Class, CommandKind, Event, EventKind, HapticState, ParametersInForce, PlanInForce, Rehearsal, Reply, ReplyStatus,
    SCHEMA_VERSION, Session, Text,
};

/// Interval of passes, half of which delays a request on average: used while requests arrive, as from a hand, and for a
/// while after.
const PASS: Duration = Duration::from_millis(2);
const QUIET_PASS: Duration = Duration::from_millis(10);
const QUIET: Duration = Duration::from_secs(1);
/// Lifetime of a refusal; a refusing server repeats it for each greeting.
const REFUSED_FOR: Duration = Duration::from_secs(3);
/// Interval of the check for new hosts and orders of a terminal, which need no quick answer.
const LOOK_EVERY: Duration = Duration::from_millis(10);
const HELLO_EVERY: Duration = Duration::from_millis(50);
/// Longest wait for a missing event.
const EVENT_PATIENCE: Duration = Duration::from_millis(500);
/// Interval of a clean-up, which takes two milliseconds and may delay records.
const CLEAN_EVERY: Duration = Duration::from_secs(10);

/// State of a member, except for the threads of records and snapshots.
pub(super) struct Rounds {
    member: Arc<Member>,
    // The board before the ports, and those before their node.
    board: Option<(u64, StateWriter)>,
    far: Far,
    left_core: Left,
    orders: Orders,
    scenes: Scenes,
    scene: (u64, u64),
    /// Run of the core and number of the last event sent to hosts here.
    event: (u64, u64),
    /// A volume on its way to the server.
    volume: Option<Volume>,
    /// The server's refusal, as last reported here.
    refused: Option<String>,
    /// Time since which an event before the next one is missing.
    event_missed: Option<Instant>,
    class: Class,
    line: Line,
    hello: Instant,
    epoch: u64,
    /// Requested state that has not arrived, and the time of the request.
    awaited: Awaited,
    has_server: bool,
    round_trip_ns: u64,
    cleaned: Instant,
    looked: Instant,
    asked: Instant,
    process: u64,
}

impl Rounds {
    pub(super) fn new(member: Arc<Member>, options: &Options) -> Result<Self, RelayError> {
        let now = Instant::now();
        Ok(Self {
            board: None,
            far: Far::new(&member.instance)?,
            left_core: Left::default(),
            orders: Orders::listen(&member.instance)?,
            member,
            scenes: Arc::new(Mutex::new(Arc::new(Rest::default()))),
            scene: (0, 0),
            event: (0, 0),
            volume: None,
            refused: None,
            event_missed: None,
            class: Class::zeroed(),
            line: Line::new(options),
            hello: now,
            epoch: 0,
            awaited: Awaited::now(),
            has_server: false,
            round_trip_ns: 0,
            cleaned: now,
            looked: now,
            asked: now,
            process: now_ns(),
        })
    }

    pub(super) fn scenes(&self) -> Scenes {
        Arc::clone(&self.scenes)
    }

    /// Returns the pause between passes without messages.
    pub(super) fn pause(&self) -> Duration {
        match self.asked.elapsed() < QUIET {
            true => PASS,
            false => QUIET_PASS,
        }
    }

    pub(super) fn pass(&mut self) {
        self.take_requests();
        if self.looked.elapsed() < LOOK_EVERY {
            return;
        }
        self.looked = Instant::now();
        self.far.connect();
        let has_server = self.member.has_server();
        if has_server != self.has_server {
            self.has_server = has_server;
            // Messages sent meanwhile were lost: the whole state is requested again.
            if has_server {
                self.ask_for_all();
            }
            say(match has_server {
                true => "connected",
                false => "the server is not heard; requests are refused",
            });
        }
        let refused = self.member.refusal(REFUSED_FOR).filter(|_| !has_server);
        if refused != self.refused {
            if let Some(why) = &refused {
                say(format!(
                    "the server refuses this member: {why}. It is asked again until it does not"
                ));
            }
            self.refused = refused;
        }
        if has_server && self.awaited.is_due(self.scene != (0, 0)) {
            let patience = self.awaited.longer();
            self.ask_for_all();
            self.awaited.patience = patience;
        }
        if self.hello.elapsed() >= HELLO_EVERY {
            self.hello = Instant::now();
            let hello = Hello {
                epoch: self.epoch,
                scene_session: self.scene.0,
                scene_generation: self.scene.1,
                round_trip_ns: self.round_trip_ns,
                lost: self.member.lost.load(Ordering::Relaxed),
            };
            self.member.say(Kind::Hello, self.process, bytemuck::bytes_of(&hello));
        }
        if let Some(relayed) = self.line.due(&self.member, &self.class, has_server, self.round_trip_ns) {
            let _ = self.far.relayed.send(relayed);
        }
        self.take_orders();
        if self.cleaned.elapsed() >= CLEAN_EVERY {
            self.cleaned = Instant::now();
            self.far.meeting.node.clean_up();
        }
    }

    fn take_orders(&self) {
        let ask = |order: &Order| self.member.ask(Kind::Lease, &[order.line().as_bytes()]);
        while let Some(order) = self.far.class.order() {
            ask(&order);
        }
        self.orders.pass(|order| match order {
            Order::Status => self.words(),
            order => {
                ask(&order);
                "asked; 'relay lease status' shows who operates".to_owned()
            }
        });
    }

    fn ask_for_all(&mut self) {
        self.epoch += 1;
        self.awaited = Awaited::now();
    }

    fn words(&self) -> String {
        let state = match self.has_server {
            true => format!(
                "connected as {}, round trip {:.1} ms",
                self.line.name(),
                self.round_trip_ns as f64 * 1e-6
            ),
            false => self.why_not(),
        };
        let lost = self.member.lost.load(Ordering::Relaxed);
        let pictures = self.member.snapshots_lost.load(Ordering::Relaxed);
        format!(
            "{state}, {lost} records lost, {pictures} snapshots lost\n{}",
            wire::class_words(&self.class)
        )
    }

    /// Takes requests of hosts. Without a server each is answered at once: none is carried out later.
    fn take_requests(&mut self) {
        let has_server = self.member.has_server();
        while let Some(command) = self.far.commands.receive() {
            self.asked = Instant::now();
            match has_server {
                true => self.member.ask(Kind::Command, &[bytemuck::bytes_of(&command)]),
                // A motion whose promises do not arrive brakes.
                false if command.kind == CommandKind::KeepMoving as u32 => {}
                false => self.refuse((command.host_id, command.command_id), &self.why_not()),
            }
        }
        while let Some(sample) = self.far.uploads.receive() {
            let header = *sample.header();
            let asker = (header.host_id, header.command_id);
            self.asked = Instant::now();
            match &self.volume {
                _ if !has_server => self.refuse(asker, &self.why_not()),
                Some(_) => self.refuse(asker, "another volume is on its way to rt-core; wait until it is there"),
                None => self.volume = Some(Volume::new(header, sample.values())),
            }
        }
        if let Some(volume) = &mut self.volume {
            self.asked = Instant::now();
            if !has_server || !volume.send_more(&self.member) {
                self.volume = None;
            }
        }
    }

    /// Returns why nothing goes to the server.
    fn why_not(&self) -> String {
        match &self.refused {
            Some(why) => format!("the server refuses this member: {why}"),
            None => "the machine with rt-core is not heard; wait until it is, and ask again".to_owned(),
        }
    }

    fn refuse(&self, (host_id, command_id): (u64, u64), why: &str) {
        let mut reply = Reply::zeroed();
        (reply.session_id, reply.host_id, reply.command_id) = (self.member.run(self.event.0), host_id, command_id);
        reply.status = ReplyStatus::Refused as u32;
        reply.text = Text::new(why);
        let _ = self.far.replies.send(reply);
    }

    /// Publishes a message to hosts here; invalid ones are dropped.
    pub(super) fn take(&mut self, bytes: &[u8]) {
        let Ok(message) = wire::decode(bytes) else { return };
        let taken = match message.kind {
            Kind::Session => self.take_session(message.body),
            Kind::State => self.take_state(message.body),
            Kind::Scene => self.take_scene(message.body),
            Kind::Event => self.take_event(message.body),
            Kind::Parameters => self.take_parameters(message.body),
            Kind::Plan => self.take_plan(message.body),
            Kind::Reply => self.take_reply(message.body),
            Kind::Rehearsal => self.take_rehearsal(message.body),
            Kind::Class => wire::class_of(message.body).map(|class| {
                let session_id = self.line.session_id;
                self.class = Class { session_id, ..class };
                self.far.class.show(self.class);
            }),
            Kind::Echo => wire::one::<u64>(message.body).map(|sent_ns| {
                let now_ns = now_ns();
                self.round_trip_ns = now_ns.saturating_sub(sent_ns).min(100 * SILENCE.as_nanos() as u64);
                self.member.clock().answered(self.round_trip_ns, now_ns);
            }),
            _ => Err(Invalid("kind of message")),
        };
        if let Err(invalid) = taken {
            say(format!("dropped: {:?} of the server: {invalid}", message.kind));
        }
    }

    fn take_session(&mut self, body: &[u8]) -> Result<(), Invalid> {
        let mut session: Session = wire::one(body)?;
        if session.schema_version != SCHEMA_VERSION || session.period_ns == 0 {
            return Err(Invalid("session"));
        }
        if self.board.as_ref().is_none_or(|(id, _)| *id != session.session_id) {
            self.board = None;
            self.open_board(session.session_id);
        }
        self.awaited.session = false;
        self.left_core.leave(&session);
        session.session_id = self.member.run(session.session_id);
        self.line.session_id = session.session_id;
        let _ = self.far.session.send(session);
        self.member.is_announced.store(true, Ordering::Relaxed);
        Ok(())
    }

    /// Opens the board, under another number if a killed member has left one that can no longer be written.
    fn open_board(&mut self, session_id: u64) {
        for _ in 0..3 {
            if let Ok(board) = StateWriter::create(&self.far.meeting.node, self.member.run(session_id)) {
                self.board = Some((session_id, board));
                return;
            }
            self.member.salt.store(now_ns().rotate_left(20), Ordering::Relaxed);
        }
    }

    fn take_state(&mut self, body: &[u8]) -> Result<(), Invalid> {
        let state: HapticState = wire::one(body)?;
        check::state(&state)?;
        if let Some((_, board)) = &self.board {
            board.write(&state);
        }
        Ok(())
    }

    fn take_scene(&mut self, body: &[u8]) -> Result<(), Invalid> {
        let (mut header, words) = wire::scene(body)?;
        let rest = Arc::new(Rest::of_scene(&header, &words));
        *self.scenes.lock().unwrap_or_else(PoisonError::into_inner) = rest;
        self.scene = (header.session_id, header.generation);
        header.session_id = self.member.run(header.session_id);
        match self.far.scene.send(&header, &words).is_ok() {
            true => Ok(()),
            false => Err(Invalid("scene without room in shared memory")),
        }
    }

    fn take_event(&mut self, body: &[u8]) -> Result<(), Invalid> {
        let mut event: Event = wire::one(body)?;
        let finite = event.value.is_finite() && event.position_m.iter().all(|c| c.is_finite());
        if !finite || EventKind::from_number(event.kind).is_none() {
            return Err(Invalid("event"));
        }
        let (session, last) = self.event;
        // Resent to a member that has it.
        if event.session_id == session && event.sequence <= last {
            return Ok(());
        }
        // The whole state is requested again, including the last events; events that are no longer kept are not waited
        // for.
        if event.session_id == session && event.sequence > last + 1 {
            let missed = self
                .event_missed
                .replace(self.event_missed.unwrap_or_else(Instant::now));
            if missed.is_none() {
                self.ask_for_all();
            }
            if missed.is_none_or(|since| since.elapsed() < EVENT_PATIENCE) {
                return Ok(());
            }
        }
        self.event_missed = None;
        self.event = (event.session_id, event.sequence);
        event.session_id = self.member.run(event.session_id);
        let _ = self.far.events.send(event);
        Ok(())
    }

    fn take_parameters(&mut self, body: &[u8]) -> Result<(), Invalid> {
        let mut parameters: ParametersInForce = wire::one(body)?;
        check::parameters(&parameters)?;
        self.awaited.parameters = false;
        parameters.session_id = self.member.run(parameters.session_id);
        let _ = self.far.parameters.send(parameters);
        Ok(())
    }

    fn take_plan(&mut self, body: &[u8]) -> Result<(), Invalid> {
        let mut plan: PlanInForce = wire::one(body)?;
        check::plan(&plan)?;
        self.awaited.plan = false;
        plan.session_id = self.member.run(plan.session_id);
        let _ = self.far.plan.send(plan);
        Ok(())
    }

    fn take_reply(&mut self, body: &[u8]) -> Result<(), Invalid> {
        let mut reply: Reply = wire::one(body)?;
        ReplyStatus::from_number(reply.status).ok_or(Invalid("status of a reply"))?;
        reply.session_id = self.member.run(reply.session_id);
        let _ = self.far.replies.send(reply);
        Ok(())
    }

    fn take_rehearsal(&mut self, body: &[u8]) -> Result<(), Invalid> {
        let mut rehearsal: Rehearsal = wire::one(body)?;
        check::rehearsal(&rehearsal)?;
        rehearsal.session_id = self.member.run(rehearsal.session_id);
        let _ = self.far.rehearsals.send(rehearsal);
        Ok(())
    }
}
