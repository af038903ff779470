//! The normal-priority thread that owns every port: hosts come and go here, and the loops do not notice.

pub mod flight;
mod parameters;
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
use parameters::{ParameterChanges, order_from_both};
use picture::IDENTITY;
pub use picture::ScenePicture;
use ports::Ports;
use rehearsals::RehearsalDesk;
use requests::{hand_goal, needle_run, plan_in_force};
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

/// A scene that a loader thread has built, or why it could not.
struct Loaded {
    ticket: Ticket,
    name: String,
    patient_from_scene: [f64; 12],
    scene: Result<(Box<Scene>, SceneSource), Refusal>,
}

/// Everything that the bridge thread owns.
pub struct Bridge {
    node: Node<Ipc>,
    ports: Ports,
    loops: LoopPorts,
    device: DeviceInfo,
    session: Session,
    parameters: ParameterChanges,
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
        let parameters = ParameterChanges::new(session.session_id);
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
            tickets: 0,
            events: 0,
            loading: false,
            loaded: mpsc::channel(),
            announced_ns: 0,
            cleaned_ns: 0,
            batch: Vec::with_capacity(MAX_BATCH),
            supervisor: Supervisor::default(),
        };
        let _ = bridge.ports.parameters.send_copy(bridge.parameters.in_force);
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
            self.report_loop_stopped();
            return Err(LoopStopped);
        }
        Ok(end)
    }

    fn report_loop_stopped(&mut self) {
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
            let refused = saved
                .result
                .err()
                .map(|why| Refusal::new(RefusalCode::FlightNotSaved, why));
            self.answer(ticket, refused.as_ref().map_or(Ok(0), Err));
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

    fn reply(&self, who: (u64, u64), result: Result<u64, &Refusal>) {
        let reply = Reply::new(self.session.session_id, who, result);
        let _ = self.ports.replies.send_copy(reply);
    }

    /// `Ok` with the first tick that ran with the change.
    fn answer(&mut self, ticket: Ticket, result: Result<u64, &Refusal>) {
        if let Some(who) = self.waiting.remove(&ticket) {
            self.reply(who, result);
        }
    }

    fn take_commands(&mut self) -> bool {
        let mut carried_out = 0;
        while let Ok(Some(sample)) = self.ports.commands.receive() {
            let command = *sample.payload();
            drop(sample);
            let who = (command.host_id, command.command_id);
            match Request::decode(&command) {
                Ok(Request::Shutdown) => {
                    self.reply(who, Ok(0));
                    return true;
                }
                // A request that takes the force off is never too much.
                Ok(request) if carried_out < MAX_REQUESTS_PER_PASS || request == Request::Disengage => {
                    carried_out += 1;
                    let ticket = self.ticket(who.0, who.1);
                    if let Err(refusal) = self.carry_out(ticket, request) {
                        self.session.refused += 1;
                        self.answer(ticket, Err(&refusal));
                    }
                }
                Ok(_) => self.refuse(who, &RefusalCode::TooManyRequests.into()),
                Err(errors) => self.refuse_invalid(who, &errors.into()),
            }
        }
        false
    }

    /// An order for a loop or work beside it. What fails later is answered later.
    fn carry_out(&mut self, ticket: Ticket, request: Request) -> Result<(), Refusal> {
        let loops = &mut self.loops;
        let taken = match request {
            Request::SetParameters(changes) => return self.change_parameters(ticket, &changes),
            Request::SetPlan(plan) => {
                self.set_plan(plan.as_ref());
                self.answer(ticket, Ok(0));
                true
            }
            Request::MoveHand(hand) => {
                let goal = hand_goal(&hand);
                loops.haptic_orders.push(HapticOrder::Hand { ticket, goal }).is_ok()
            }
            Request::StopHand => loops.haptic_orders.push(HapticOrder::StopHand { ticket }).is_ok(),
            Request::Engage => loops.haptic_orders.push(HapticOrder::Engage { ticket }).is_ok(),
            Request::Disengage => loops.haptic_orders.push(HapticOrder::Disengage { ticket }).is_ok(),
            Request::DropSeed => loops.tissue_orders.push(TissueOrder::DropSeed { ticket }).is_ok(),
            Request::UndoSeed => loops.tissue_orders.push(TissueOrder::UndoSeed { ticket }).is_ok(),
            Request::Reset => self.reset(ticket),
            Request::LoadBuiltinScene(number) => {
                let name = BUILTIN_SCENES[number as usize];
                self.load(ticket, name.to_owned(), IDENTITY, || {
                    let source = SceneSource::Builtin(name.to_owned());
                    let scene = source
                        .build()
                        .map_err(|why| Refusal::new(RefusalCode::SceneNotBuilt, why))?;
                    Ok((scene, source))
                });
                true
            }
            Request::Rehearse(run) => {
                let (set, generation) = (self.parameters.in_force.set, self.picture.header.generation);
                if let Err(refusal) = self.rehearsals.begin(ticket, needle_run(&run), set, generation) {
                    self.answer(ticket, Err(&refusal));
                }
                true
            }
            Request::SaveFlight => loops.flight.request(ticket),
            Request::Shutdown => true,
        };
        taken.then_some(()).ok_or(RefusalCode::TooManyRequests.into())
    }

    /// Verified as a whole, then ordered from both loops or from none.
    fn change_parameters(&mut self, ticket: Ticket, changes: &[ParameterChange]) -> Result<(), Refusal> {
        let set = self.parameters.with(changes);
        let active = activate(&set, &self.device).map_err(|problems| {
            let refusal = Refusal::from(problems);
            self.report_invalid(&refusal);
            refusal
        })?;
        let generation = self.parameters.next_generation();
        let haptic = HapticOrder::Parameters {
            ticket,
            generation,
            needle: active.needle,
            force: active.force,
        };
        let orders = (haptic, TissueOrder::Limits(active.limits));
        let loops = &mut self.loops;
        if !order_from_both(&mut loops.haptic_orders, &mut loops.tissue_orders, orders) {
            return Err(RefusalCode::TooManyRequests.into());
        }
        self.parameters.ordered(generation, set);
        Ok(())
    }

    fn set_plan(&mut self, plan: Option<&PlannedNeedle>) {
        let generation = self.plan.generation + 1;
        self.plan = plan_in_force(plan);
        self.plan.generation = if plan.is_some() { generation } else { 0 };
        self.plan.session_id = self.session.session_id;
        self.plan.scene_generation = self.picture.header.generation;
        let _ = self.ports.plan.send_copy(self.plan);
    }

    fn reset(&mut self, ticket: Ticket) -> bool {
        let orders = (HapticOrder::Reset { ticket }, TissueOrder::Reset);
        let loops = &mut self.loops;
        let taken = order_from_both(&mut loops.haptic_orders, &mut loops.tissue_orders, orders);
        if taken {
            self.event(EventKind::Reset, 0, 0.0, [0.0; 3], (0, clock::now_ns()), "");
        }
        taken
    }

    fn refuse(&mut self, who: (u64, u64), refusal: &Refusal) {
        self.session.refused += 1;
        self.reply(who, Err(refusal));
    }

    fn refuse_invalid(&mut self, who: (u64, u64), refusal: &Refusal) {
        self.report_invalid(refusal);
        self.refuse(who, refusal);
    }

    fn report_invalid(&mut self, refusal: &Refusal) {
        let now_ns = clock::now_ns();
        self.event(EventKind::InvalidRefused, 0, 0.0, [0.0; 3], (0, now_ns), &refusal.text);
    }

    fn take_uploads(&mut self) {
        while let Ok(Some(sample)) = self.ports.uploads.receive() {
            let header = *sample.user_header();
            let who = (header.host_id, header.command_id);
            let name = header.name.read();
            let labels = match upload::labels(&header, sample.payload()) {
                Ok(labels) => labels,
                Err(why) => {
                    self.refuse_invalid(who, &Refusal::new(RefusalCode::InvalidVolume, why));
                    continue;
                }
            };
            drop(sample);
            let ticket = self.ticket(who.0, who.1);
            self.load(ticket, name.clone(), header.patient_from_scene, move || {
                let source = SceneSource::of_labels(&name, &labels);
                Scene::from_labels(&name, &labels)
                    .map(|scene| (scene, source))
                    .map_err(|problems| {
                        let lines: Vec<_> = problems.iter().map(ToString::to_string).collect();
                        Refusal::new(RefusalCode::InvalidVolume, lines.join("\n"))
                    })
            });
        }
    }

    /// Builds a scene beside the bridge; the running one goes on until it is ready.
    fn load(
        &mut self,
        ticket: Ticket,
        name: String,
        patient_from_scene: [f64; 12],
        build: impl FnOnce() -> Result<(Scene, SceneSource), Refusal> + Send + 'static,
    ) {
        if self.loading || self.coming.is_some() {
            self.answer(ticket, Err(&RefusalCode::SceneLoading.into()));
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
            let why = "no thread could be started to load the scene";
            self.answer(ticket, Err(&Refusal::new(RefusalCode::Internal, why)));
        }
    }

    fn take_loaded(&mut self) {
        let Ok(loaded) = self.loaded.1.try_recv() else { return };
        self.loading = false;
        let (mut scene, source) = match loaded.scene {
            Ok(built) => built,
            Err(refusal) => return self.answer(loaded.ticket, Err(&refusal)),
        };
        scene.tissue = self.tissue;
        // Changes on their way to the tissue loop reach it before the scene does.
        let limits = match activate(&self.parameters.with(&[]), &self.device) {
            Ok(active) => active.limits,
            Err(problems) => return self.answer(loaded.ticket, Err(&problems.into())),
        };
        let generation = self.picture.header.generation + 1;
        let mut picture = ScenePicture::of(&scene, self.session.session_id, generation, loaded.patient_from_scene);
        picture.header.name = Text::new(&loaded.name);
        let world = match World::new(*scene, limits, generation) {
            Ok(world) => Box::new(world),
            Err(why) => {
                let refusal = Refusal::new(RefusalCode::SceneNotBuilt, why);
                return self.answer(loaded.ticket, Err(&refusal));
            }
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
            let why = "too many requests at once; load the scene again";
            let refusal = Refusal::new(RefusalCode::TooManyRequests, why);
            return self.answer(loaded.ticket, Err(&refusal));
        }
        self.coming = Some((picture, source));
    }

    /// The result goes out before the reply, so that a host that has its reply has all.
    fn take_rehearsed(&mut self) {
        let Some(ended) = self.rehearsals.take(self.picture.header.generation) else {
            return;
        };
        let who = self.waiting.get(&ended.ticket).copied();
        if let (Ok(result), Some((host_id, command_id))) = (&ended.outcome, who) {
            let _ = self.ports.rehearsals.send_copy(Rehearsal {
                session_id: self.session.session_id,
                host_id,
                command_id,
                ..**result
            });
        }
        self.answer(ended.ticket, ended.outcome.as_ref().map(|_| 0));
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
            Notice::Done { ticket, tick } => self.answer(ticket, Ok(tick)),
            Notice::Refused { ticket, why } => self.answer(ticket, Err(&why.into())),
            Notice::ParametersActive {
                ticket,
                generation,
                tick,
            } => {
                if self.parameters.take_effect(generation, tick) {
                    let _ = self.ports.parameters.send_copy(self.parameters.in_force);
                }
                self.answer(ticket, Ok(tick));
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
                self.answer(ticket, Ok(tick));
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
