//! The normal-priority thread of the force process: carries out the requests of hosts and reports what the loops do.
//!
//! Hosts are served by another process, behind a [`Wall`].

mod answers;
mod commands;
mod exercises;
mod flight;
mod line_archive;
mod lines;
mod link;
mod movers;
mod notices;
mod parameters;
mod picture;
mod probe;
mod rehearsals;
mod scenes;
mod second;
mod supervisor;
mod upload;
mod wall;

use crate::replay::file::Flight;
use crate::rt::exchange::{HapticOrder, Ticket, TissueOrder};
use crate::rt::second::SecondControlPorts;
use crate::rt::wiring::{ControlPorts, TapePorts};
use flight::FlightKeeper;
pub use flight::SaveError;
use lines::LinePreparer;
use link::Link;
use parameters::ParameterChanges;
pub use picture::{ScenePicture, snapshot_len};
use probe::ProbePreparer;
use rehearsals::RehearsalRunner;
use scenes::RunningScene;
use second::Second;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use stylet_hw::DeviceInfo;
use stylet_shm_schema::{Event, EventKind, PlanInForce, Refusal, RefusalCode, Rehearsal, Session, Text};
use stylet_sim::scene::SceneSource;
use stylet_sim::tissue::TissueSpec;
use stylet_wall::kind::Kind;
pub(crate) use supervisor::LOOP_ENDED;
use supervisor::Supervisor;
pub use wall::{Asked, Desk, Here, Told, Wall};
#[cfg(not(target_family = "wasm"))]
pub use wall::{Bridge, BridgeError, watcher};

const PASS: Duration = Duration::from_millis(2);

/// The force loop has stopped unasked.
#[derive(Debug, thiserror::Error)]
#[error("{}", LOOP_ENDED)]
pub struct LoopStopped;

/// Settings of a control thread.
pub struct ControlSetup {
    /// The haptic device.
    pub device: DeviceInfo,
    /// Announcement of the run.
    pub session: Session,
    /// First scene, as sent to hosts.
    pub picture: ScenePicture,
    /// Tissue model of every scene.
    pub tissue: TissueSpec,
    /// Source of the first scene.
    pub source: Arc<SceneSource>,
    /// Second device, if the run has one, and the ends of its rings.
    pub second: Option<(DeviceInfo, SecondControlPorts)>,
    /// Folder of the saved probe answers.
    pub probe_folder: Option<PathBuf>,
    /// Folder of the flight recordings, and the part common to all; `None` in a run that keeps none.
    pub flights: Option<(PathBuf, Flight)>,
}

/// State of the control thread.
pub struct Control {
    link: Link,
    loops: ControlPorts,
    flights: Option<FlightKeeper>,
    device: DeviceInfo,
    /// Tissue model of every scene of the run.
    tissue: TissueSpec,
    parameters: ParameterChanges,
    plan: PlanInForce,
    scene: RunningScene,
    rehearsals: RehearsalRunner,
    lines: LinePreparer,
    /// Present in a run whose second hand holds the probe.
    probe: Option<ProbePreparer>,
    /// Room for needles that stay in was sent: to the force loop, and to the tissue loop's tape of that scene.
    left_rooms: (bool, Option<u64>),
    supervisor: Supervisor,
    second: Option<Second>,
    movers: movers::Movers,
}

impl Control {
    /// Announces parameters and plan; the rest follows in [`run`](Self::run).
    pub fn new(wall: Box<dyn Wall>, loops: ControlPorts, (haptic, tissue): TapePorts, setup: ControlSetup) -> Self {
        let session_id = setup.session.session_id;
        let is_real_time = setup.session.haptic.is_fifo();
        let mut plan: PlanInForce = bytemuck::Zeroable::zeroed();
        plan.session_id = session_id;
        let parameters = ParameterChanges::new(session_id);
        let work = wall.work();
        let mut link = Link::new(wall, setup.session);
        link.wall.keep(Kind::Parameters, &parameters.in_force);
        link.wall.keep(Kind::Plan, &plan);
        setup.picture.show(link.wall.as_mut());
        let (second, second_tapes) = setup.second.map(|second| Second::new(second, is_real_time)).unzip();
        let tapes = (haptic, tissue, second_tapes);
        Self {
            link,
            flights: setup
                .flights
                .map(|(folder, common)| FlightKeeper::new(tapes, folder, common)),
            loops,
            device: setup.device,
            tissue: setup.tissue,
            parameters,
            plan,
            scene: RunningScene::new(setup.picture),
            probe: second
                .is_some()
                .then(|| ProbePreparer::new(Arc::clone(&setup.source), setup.tissue, setup.probe_folder, work)),
            lines: LinePreparer::new(Arc::clone(&setup.source), setup.tissue, work),
            rehearsals: RehearsalRunner::new(setup.source, setup.tissue, setup.device, work),
            left_rooms: (false, None),
            supervisor: Supervisor::new(is_real_time, setup.device.simulated),
            second,
            movers: movers::Movers::default(),
        }
    }

    /// Serves hosts until `stopped` or a host asks to end. Fails when the force loop has stopped unasked: the loops
    /// must not be waited for then.
    pub fn run(&mut self, stopped: impl Fn() -> bool) -> Result<(), LoopStopped> {
        while !stopped() && !self.pass()? {
            // A request is taken as soon as it arrives; a pass keeps a minimum length because the supervisor counts
            // passes.
            let begun = Instant::now();
            self.link.wall.wait(PASS);
            if let Some(rest) = PASS.checked_sub(begun.elapsed()) {
                self.link.wall.pass();
                if self.take_commands() {
                    break;
                }
                std::thread::sleep(rest);
            }
        }
        Ok(())
    }

    /// Saves a recording after the force loop has stopped: gives the other loops `limit` to hand over their tapes. The
    /// force loop's own tape is missing unless the loop resumes in time.
    pub fn save_flight_of_stopped(&mut self, limit: Duration) -> Result<PathBuf, SaveError> {
        let generation = self.scene.generation();
        let flights = self.flights.as_mut().ok_or(SaveError::NothingRecorded)?;
        flights.save_stopped(generation, self.lines.archive(), LOOP_ENDED, limit)
    }

    /// Writes the last recording, after both loops have ended.
    pub fn save_last_flight(&mut self) -> Result<PathBuf, SaveError> {
        let flights = self.flights.as_mut().ok_or(SaveError::NothingRecorded)?;
        flights.save_at_end(self.scene.generation(), self.lines.archive())
    }

    /// Runs one pass; true when a host asked to end.
    pub(crate) fn pass(&mut self) -> Result<bool, LoopStopped> {
        self.link.announce();
        let before = self.newest_tick();
        let end = self.take_commands();
        self.take_loaded();
        self.take_rehearsed();
        self.take_notices();
        while self.loops.old_worlds.pop().is_ok() {}
        self.link.send_records(&mut self.loops.records);
        let made_a_tick = self.newest_tick() != before;
        self.pass_second();
        self.serve_flights();
        let generation = self.scene.generation();
        let now_ns = self.link.wall.now_ns();
        let newest = self.link.newest_record();
        self.lines.pass(now_ns, newest, generation, &mut self.loops);
        self.serve_probe(generation);
        self.supervise(made_a_tick)?;
        Ok(end)
    }

    fn newest_tick(&self) -> Option<u64> {
        self.link.newest_record().map(|record| record.tick)
    }

    fn serve_probe(&mut self, generation: u64) {
        let Some(probe) = &mut self.probe else { return };
        if let Some(why) = probe.pass(generation, &mut self.loops) {
            eprintln!("rt-core: {why}");
        }
    }

    /// Queues a recording for a host.
    fn save_flight(&mut self, ticket: Ticket) -> Result<(), Refusal> {
        let none = || Refusal::new(RefusalCode::FlightNotSaved, "this core keeps no flight recordings");
        let taken = self.flights.as_mut().ok_or_else(none)?.request(ticket);
        taken.then_some(()).ok_or(RefusalCode::TooManyRequests.into())
    }

    /// Queues a recording of a fault.
    fn fault_flight(&mut self, message: &str) {
        if let Some(flights) = &mut self.flights {
            flights.fault(message, self.link.wall.now_ns());
        }
    }

    fn serve_flights(&mut self) {
        let Some(flights) = &mut self.flights else { return };
        let (generation, now_ns) = (self.scene.generation(), self.link.wall.now_ns());
        let (loops, second) = (&mut self.loops, &mut self.second);
        let saved = flights.pass(now_ns, generation, self.lines.archive(), || {
            // A ring that is full leaves its loop out.
            let _ = loops.haptic_orders.push((0, HapticOrder::HandOverTape));
            let _ = loops.tissue_orders.push(TissueOrder::HandOverTape);
            if let Some(second) = second {
                let _ = second.orders.push((0, HapticOrder::HandOverTape));
            }
        });
        let Some(saved) = saved else { return };
        let result = saved.result.map_err(|why| why.to_string());
        let (code, text) = match &result {
            Ok(path) => (0, path.display().to_string()),
            Err(why) => (1, why.clone()),
        };
        self.link.event(Event {
            code,
            text: Text::new(&text),
            ..self.link.event_now(EventKind::FlightSaved)
        });
        if let Some(ticket) = saved.ticket {
            let refusal = result.err().map(|why| Refusal::new(RefusalCode::FlightNotSaved, why));
            self.link.answer(ticket, refusal.as_ref().map_or(Ok(0), Err));
        }
    }

    /// Sends the result before the reply, so that a host with its reply has everything.
    fn take_rehearsed(&mut self) {
        let Some(ended) = self.rehearsals.take(self.scene.generation()) else {
            return;
        };
        if let (Ok(result), Some((host_id, command_id))) = (&ended.outcome, self.link.answers.asker(ended.ticket)) {
            let rehearsal = Rehearsal {
                session_id: self.link.session.session_id,
                host_id,
                command_id,
                ..**result
            };
            self.link.wall.keep(Kind::Rehearsal, &rehearsal);
        }
        self.link.answer(ended.ticket, ended.outcome.as_ref().map(|_| 0));
    }
}
