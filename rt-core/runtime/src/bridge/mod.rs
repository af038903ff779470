//! The normal-priority thread that owns every port: hosts come and go here, and the loops do not notice.

pub mod flight;
mod picture;
pub mod ports;
mod rehearsals;
mod requests;
mod snapshots;
mod supervisor;
mod upload;

use crate::rt::clock;
use crate::rt::exchange::*;
use crate::rt::tissue_tape::TissueTape;
use crate::rt::world::World;
use flight::FlightDesk;
use iceoryx2::node::Node;
use picture::IDENTITY;
pub use picture::ScenePicture;
use ports::Ports;
use rehearsals::RehearsalDesk;
use requests::Request;
pub use snapshots::{SnapshotLoans, SnapshotSize};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Arc, mpsc};
use std::time::Duration;
use stylet_hw::DeviceInfo;
use stylet_shm_schema::service::{Ipc, MAX_BATCH};
use stylet_shm_schema::*;
use stylet_sim::active::activate;
use stylet_sim::scene::TissueKind;
use stylet_sim::scene::{Scene, SceneSource};
use supervisor::Supervisor;

const PASS: Duration = Duration::from_millis(2);
const ANNOUNCE_NS: u64 = 200_000_000;
const CLEAN_UP_NS: u64 = 1_000_000_000;
/// Requests carried out in one pass. More are refused, so that a flood reaches neither loop.
const MAX_REQUESTS_PER_PASS: u32 = 16;

/// Ends of the rings to and from both loops.
pub struct LoopPorts {
    pub records: rtrb::Consumer<TickRecord>,
    pub haptic_orders: rtrb::Producer<HapticOrder>,
    pub haptic_notices: rtrb::Consumer<Notice>,
    pub tissue_orders: rtrb::Producer<TissueOrder>,
    pub tissue_notices: rtrb::Consumer<Notice>,
    pub old_worlds: rtrb::Consumer<Box<World>>,
    pub loans: SnapshotLoans,
    pub flight: FlightDesk,
}

/// The force loop has stopped by itself.
#[derive(Debug)]
pub struct LoopStopped;

const TOO_MANY: &str = "too many requests at once; send fewer";

/// A scene that a loader thread has built, or why it could not.
struct Loaded {
    ticket: Ticket,
    name: String,
    patient_from_scene: [f64; 12],
    scene: Result<(Box<Scene>, SceneSource), String>,
}

/// Everything that the bridge thread owns.
pub struct Bridge {
    node: Node<Ipc>,
    ports: Ports,
    loops: LoopPorts,
    device: DeviceInfo,
    session: Session,
    parameters: ParametersInForce,
    plan: PlanInForce,
    /// The scene that runs, and the one handed to the tissue loop but not yet taken up.
    picture: ScenePicture,
    /// The tissue model of every scene of the run.
    tissue: TissueKind,
    picture_sent: bool,
    coming: Option<(ScenePicture, Arc<SceneSource>)>,
    rehearsals: RehearsalDesk,
    /// Who waits for what: host and command behind each ticket.
    waiting: HashMap<Ticket, (u64, u64)>,
    waiting_parameters: HashMap<u64, ParameterSet>,
    tickets: Ticket,
    events: u64,
    loading: bool,
    loaded: (mpsc::Sender<Loaded>, mpsc::Receiver<Loaded>),
    announced_ns: u64,
    cleaned_ns: u64,
    batch: Vec<TickRecord>,
    supervisor: Supervisor,
}

impl Bridge {
    pub fn new(
        node: Node<Ipc>,
        ports: Ports,
        loops: LoopPorts,
        device: DeviceInfo,
        session: Session,
        picture: ScenePicture,
        (tissue, source): (TissueKind, Arc<SceneSource>),
    ) -> Self {
        let mut plan: PlanInForce = bytemuck::Zeroable::zeroed();
        plan.session_id = session.session_id;
        let parameters = ParametersInForce {
            session_id: session.session_id,
            generation: 1,
            effective_tick: 0,
            set: ParameterSet::default(),
        };
        let bridge = Self {
            node,
            ports,
            loops,
            device,
            session,
            parameters,
            plan,
            picture,
            tissue,
            picture_sent: false,
            coming: None,
            rehearsals: RehearsalDesk::new(source, tissue, device),
            waiting: HashMap::new(),
            waiting_parameters: HashMap::new(),
            tickets: 0,
            events: 0,
            loading: false,
            loaded: mpsc::channel(),
            announced_ns: 0,
            cleaned_ns: 0,
            batch: Vec::with_capacity(MAX_BATCH),
            supervisor: Supervisor::default(),
        };
        let _ = bridge.ports.parameters.send_copy(bridge.parameters);
        let _ = bridge.ports.plan.send_copy(bridge.plan);
        bridge
    }

    /// Serves hosts until `stopped` or a host asks to end. An error when the force loop has stopped by itself: then
    /// neither loop must be waited for.
    pub fn run(&mut self, stopped: impl Fn() -> bool) -> Result<(), LoopStopped> {
        while !stopped() {
            if self.pass()? {
                return Ok(());
            }
            std::thread::sleep(PASS);
        }
        Ok(())
    }

    /// Both loops have ended: writes what they recorded last.
    pub fn save_last_flight(&mut self) -> Result<PathBuf, String> {
        self.loops.flight.save_at_end(self.picture.header.generation)
    }

    /// One pass; true when a host asked to end.
    fn pass(&mut self) -> Result<bool, LoopStopped> {
        self.ports.update_connections();
        self.announce();
        let end = self.take_commands();
        self.take_uploads();
        self.take_loaded();
        self.take_rehearsed();
        self.take_notices();
        if !self.picture_sent {
            self.send_scene();
        }
        while self.loops.old_worlds.pop().is_ok() {}
        let made_a_tick = self.send_records();
        self.serve_flights();
        let (generation, size) = (self.picture.header.generation, self.picture.snapshot_size());
        self.loops.loans.pass(&self.ports, generation, size);
        if self.supervisor.pass(made_a_tick) {
            self.tell_loop_stopped();
            return Err(LoopStopped);
        }
        Ok(end)
    }

    fn tell_loop_stopped(&mut self) {
        let fault = Fault::LoopStopped;
        let now_ns = clock::now_ns();
        self.event(
            EventKind::FaultRaised,
            fault as u32,
            0.0,
            [0.0; 3],
            (0, now_ns),
            fault.message(),
        );
    }

    fn serve_flights(&mut self) {
        let loops = &mut self.loops;
        let generation = self.picture.header.generation;
        let saved = loops
            .flight
            .pass(generation, &mut loops.haptic_orders, &mut loops.tissue_orders);
        let Some(saved) = saved else { return };
        let (code, text) = match &saved.result {
            Ok(path) => (0, path.display().to_string()),
            Err(why) => (1, why.clone()),
        };
        self.event(EventKind::FlightSaved, code, 0.0, [0.0; 3], (0, clock::now_ns()), &text);
        if let Some(ticket) = saved.ticket {
            self.answer(ticket, saved.result.as_ref().err().map(String::as_str), 0);
        }
    }

    fn announce(&mut self) {
        let now_ns = clock::now_ns();
        if now_ns - self.announced_ns >= ANNOUNCE_NS {
            self.announced_ns = now_ns;
            self.session.time_ns = now_ns;
            let _ = self.ports.session.send_copy(self.session);
        }
        if now_ns - self.cleaned_ns >= CLEAN_UP_NS {
            self.cleaned_ns = now_ns;
            self.node.try_cleanup_dead_nodes();
        }
    }

    /// True when the force loop has made a tick.
    fn send_records(&mut self) -> bool {
        let mut any = false;
        loop {
            while self.batch.len() < MAX_BATCH
                && let Ok(record) = self.loops.records.pop()
            {
                self.batch.push(record);
            }
            if self.batch.is_empty() {
                return any;
            }
            any = true;
            if let Ok(mut sample) = self.ports.records.loan_slice_uninit(self.batch.len()) {
                *sample.user_header_mut() = self.session.session_id;
                let _ = sample.write_from_slice(&self.batch).send();
            }
            self.batch.clear();
        }
    }

    /// Tried again at the next pass when there is no room.
    fn send_scene(&mut self) {
        if let Ok(mut sample) = self.ports.scene.loan_slice_uninit(self.picture.words.len()) {
            *sample.user_header_mut() = self.picture.header;
            self.picture_sent = sample.write_from_slice(&self.picture.words).send().is_ok();
        }
    }

    fn ticket(&mut self, host: u64, command: u64) -> Ticket {
        self.tickets += 1;
        self.waiting.insert(self.tickets, (host, command));
        self.tickets
    }

    fn reply(&self, (host_id, command_id): (u64, u64), refused: Option<&str>, effective_tick: u64) {
        let status = if refused.is_some() {
            ReplyStatus::Refused
        } else {
            ReplyStatus::Accepted
        };
        let _ = self.ports.replies.send_copy(Reply {
            session_id: self.session.session_id,
            host_id,
            command_id,
            effective_tick,
            status: status as u32,
            reserved: 0,
            text: Text::new(refused.unwrap_or("")),
        });
    }

    fn answer(&mut self, ticket: Ticket, refused: Option<&str>, tick: u64) {
        if let Some(who) = self.waiting.remove(&ticket) {
            self.reply(who, refused, tick);
        }
    }

    fn take_commands(&mut self) -> bool {
        let mut carried_out = 0;
        while let Ok(Some(sample)) = self.ports.commands.receive() {
            let command = *sample.payload();
            drop(sample);
            let who = (command.host_id, command.command_id);
            match requests::read(&command, &self.parameters.set, &self.device) {
                Ok(Request::Shutdown) => {
                    self.reply(who, None, 0);
                    return true;
                }
                // A request to let go is never too much.
                Ok(request) if carried_out < MAX_REQUESTS_PER_PASS || request.lets_go() => {
                    carried_out += 1;
                    self.carry_out(request, who);
                }
                Ok(_) => self.refuse(who, TOO_MANY),
                Err(why) => {
                    self.event(EventKind::RubbishRefused, 0, 0.0, [0.0; 3], (0, clock::now_ns()), &why);
                    self.refuse(who, &why);
                }
            }
        }
        false
    }

    fn carry_out(&mut self, request: Request, who: (u64, u64)) {
        let ticket = self.ticket(who.0, who.1);
        let taken = match request {
            Request::Parameters(set, active) => {
                let generation = self.parameters.generation + 1 + self.waiting_parameters.len() as u64;
                self.waiting_parameters.insert(generation, *set);
                let order = HapticOrder::Parameters {
                    ticket,
                    generation,
                    needle: active.needle,
                    force: active.force,
                };
                self.loops
                    .tissue_orders
                    .push(TissueOrder::Limits(active.limits))
                    .is_ok()
                    && self.loops.haptic_orders.push(order).is_ok()
            }
            Request::Plan(plan) => {
                let generation = self.plan.generation + 1;
                let empty = plan.generation == 0;
                self.plan = *plan;
                self.plan.generation = if empty { 0 } else { generation };
                self.plan.session_id = self.session.session_id;
                self.plan.scene_generation = self.picture.header.generation;
                let _ = self.ports.plan.send_copy(self.plan);
                self.answer(ticket, None, 0);
                true
            }
            Request::Haptic(order) => self.loops.haptic_orders.push(order(ticket)).is_ok(),
            Request::Hand(goal) => self
                .loops
                .haptic_orders
                .push(HapticOrder::Hand { ticket, goal })
                .is_ok(),
            Request::Tissue(order) => self.loops.tissue_orders.push(order(ticket)).is_ok(),
            Request::Reset => {
                self.event(EventKind::Reset, 0, 0.0, [0.0; 3], (0, clock::now_ns()), "");
                self.loops.tissue_orders.push(TissueOrder::Reset).is_ok()
                    && self.loops.haptic_orders.push(HapticOrder::Reset { ticket }).is_ok()
            }
            Request::BuiltinScene(name) => {
                self.load(ticket, name.to_owned(), IDENTITY, || {
                    let source = SceneSource::Builtin(name.to_owned());
                    source.build().map(|scene| (scene, source))
                });
                true
            }
            Request::Rehearse(run) => {
                let (set, generation) = (self.parameters.set, self.picture.header.generation);
                if let Err(why) = self.rehearsals.begin(ticket, *run, set, generation) {
                    self.answer(ticket, Some(why), 0);
                }
                true
            }
            Request::SaveFlight => self.loops.flight.request(ticket),
            Request::Shutdown => true,
        };
        if !taken {
            self.session.refused += 1;
            self.answer(ticket, Some(TOO_MANY), 0);
        }
    }

    fn refuse(&mut self, who: (u64, u64), why: &str) {
        self.session.refused += 1;
        self.reply(who, Some(why), 0);
    }

    fn take_uploads(&mut self) {
        while let Ok(Some(sample)) = self.ports.uploads.receive() {
            let header = *sample.user_header();
            let who = (header.host_id, header.command_id);
            let name = header.name.read();
            let labels = match upload::labels(&header, sample.payload()) {
                Ok(labels) => labels,
                Err(why) => {
                    self.event(EventKind::RubbishRefused, 0, 0.0, [0.0; 3], (0, clock::now_ns()), &why);
                    self.refuse(who, &why);
                    continue;
                }
            };
            drop(sample);
            let ticket = self.ticket(who.0, who.1);
            self.load(ticket, name.clone(), header.patient_from_scene, move || {
                let source = SceneSource::of_labels(&name, &labels);
                Scene::from_labels(&name, &labels)
                    .map(|scene| (scene, source))
                    .map_err(|problems| problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
            });
        }
    }

    /// Builds a scene beside the bridge; the running one goes on until it is ready.
    fn load(
        &mut self,
        ticket: Ticket,
        name: String,
        patient_from_scene: [f64; 12],
        build: impl FnOnce() -> Result<(Scene, SceneSource), String> + Send + 'static,
    ) {
        if self.loading || self.coming.is_some() {
            self.answer(ticket, Some("another scene is being loaded; wait until it is ready"), 0);
            return;
        }
        self.loading = true;
        let sender = self.loaded.0.clone();
        let built = std::thread::Builder::new()
            .name("scene-loader".to_owned())
            .spawn(move || {
                let scene = build().map(|(scene, source)| (Box::new(scene), source));
                let _ = sender.send(Loaded {
                    ticket,
                    name,
                    patient_from_scene,
                    scene,
                });
            });
        if built.is_err() {
            self.loading = false;
            self.answer(ticket, Some("no thread could be started to load the scene"), 0);
        }
    }

    fn take_loaded(&mut self) {
        let Ok(loaded) = self.loaded.1.try_recv() else { return };
        self.loading = false;
        let (mut scene, source) = match loaded.scene {
            Ok(built) => built,
            Err(why) => return self.answer(loaded.ticket, Some(&why), 0),
        };
        scene.tissue = self.tissue;
        let limits = match activate(&self.parameters.set, &self.device) {
            Ok(active) => active.limits,
            Err(why) => return self.answer(loaded.ticket, Some(&why.join("\n")), 0),
        };
        let generation = self.picture.header.generation + 1;
        let mut picture = ScenePicture::of(&scene, self.session.session_id, generation, loaded.patient_from_scene);
        picture.header.name = Text::new(&loaded.name);
        let world = match World::new(*scene, limits, generation) {
            Ok(world) => Box::new(world),
            Err(why) => return self.answer(loaded.ticket, Some(&why), 0),
        };
        let source = Arc::new(source);
        let tape = Box::new(TissueTape::new(&world, Arc::clone(&source)));
        if self
            .loops
            .tissue_orders
            .push(TissueOrder::World {
                ticket: loaded.ticket,
                world,
                tape,
            })
            .is_err()
        {
            return self.answer(
                loaded.ticket,
                Some("too many requests at once; load the scene again"),
                0,
            );
        }
        self.coming = Some((picture, source));
    }

    /// The result goes out before the reply, so that a host that has its reply has all.
    fn take_rehearsed(&mut self) {
        let Some(told) = self.rehearsals.take(self.picture.header.generation) else {
            return;
        };
        let who = self.waiting.get(&told.ticket).copied();
        if let (Ok(result), Some((host_id, command_id))) = (&told.outcome, who) {
            let _ = self.ports.rehearsals.send_copy(Rehearsal {
                session_id: self.session.session_id,
                host_id,
                command_id,
                ..**result
            });
        }
        self.answer(told.ticket, told.outcome.as_ref().err().map(String::as_str), 0);
    }

    fn take_notices(&mut self) {
        while let Ok(notice) = self.loops.haptic_notices.pop() {
            self.take_notice(notice);
        }
        while let Ok(notice) = self.loops.tissue_notices.pop() {
            self.take_notice(notice);
        }
    }

    fn take_notice(&mut self, notice: Notice) {
        match notice {
            Notice::Done { ticket, tick } => self.answer(ticket, None, tick),
            Notice::Refused { ticket, why } => self.answer(ticket, Some(why.message()), 0),
            Notice::ParametersActive {
                ticket,
                generation,
                tick,
            } => {
                if let Some(set) = self.waiting_parameters.remove(&generation) {
                    self.parameters = ParametersInForce {
                        session_id: self.session.session_id,
                        generation,
                        effective_tick: tick,
                        set,
                    };
                    let _ = self.ports.parameters.send_copy(self.parameters);
                }
                self.answer(ticket, None, tick);
            }
            Notice::WorldSwapped {
                ticket,
                generation,
                tick,
            } => {
                if let Some((picture, source)) = self.coming.take() {
                    self.picture = picture;
                    self.rehearsals.change_scene(source);
                    self.picture_sent = false;
                    self.send_scene();
                    self.plan = bytemuck::Zeroable::zeroed();
                    self.plan.session_id = self.session.session_id;
                    let _ = self.ports.plan.send_copy(self.plan);
                }
                let name = self.picture.header.name.read();
                self.event(
                    EventKind::SceneLoaded,
                    generation as u32,
                    0.0,
                    [0.0; 3],
                    (tick, clock::now_ns()),
                    &name,
                );
                self.answer(ticket, None, tick);
            }
            Notice::Contact {
                tick,
                time_ns,
                position_m,
            } => {
                self.event(EventKind::Contact, 0, 0.0, position_m.into(), (tick, time_ns), "");
            }
            Notice::Puncture {
                tick,
                time_ns,
                depth_m,
                position_m,
            } => {
                self.event(EventKind::Puncture, 0, depth_m, position_m.into(), (tick, time_ns), "");
            }
            Notice::LeftTissue { tick, time_ns } => {
                self.event(EventKind::LeftTissue, 0, 0.0, [0.0; 3], (tick, time_ns), "");
            }
            Notice::Seed {
                tick,
                time_ns,
                index,
                position_m,
            } => {
                self.event(
                    EventKind::SeedDropped,
                    index,
                    0.0,
                    position_m.into(),
                    (tick, time_ns),
                    "",
                );
            }
            Notice::Fault { tick, time_ns, fault } => {
                self.loops.flight.fault(fault.message());
                self.event(
                    EventKind::FaultRaised,
                    fault as u32,
                    0.0,
                    [0.0; 3],
                    (tick, time_ns),
                    fault.message(),
                );
            }
            Notice::Rearmed { tick, time_ns } => {
                self.event(EventKind::Rearmed, 0, 0.0, [0.0; 3], (tick, time_ns), "");
            }
        }
    }

    fn event(
        &mut self,
        kind: EventKind,
        code: u32,
        value: f64,
        position_m: [f64; 3],
        (tick, time_ns): (u64, u64),
        text: &str,
    ) {
        self.events += 1;
        let _ = self.ports.events.send_copy(Event {
            session_id: self.session.session_id,
            sequence: self.events,
            time_ns,
            tick,
            kind: kind as u32,
            code,
            value,
            position_m,
            text: Text::new(text),
        });
    }
}
