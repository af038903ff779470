//! A whole core on one thread: the two loops and the control thread of a run, stepped by the host in the same process.
//!
//! A browser runs it, which has neither threads nor shared memory. Its simulated device has a simulated hand, which
//! requests move; its long work is done inside a step. The same steps give the same bytes.

use crate::control::{Asked, Control, ControlSetup, Desk, Here, ScenePicture, Told, Wall, snapshot_len};
use crate::rt::clock::{HAPTIC_PERIOD_NS, TISSUE_PERIOD_NS};
use crate::rt::haptic::HapticLoop;
use crate::rt::haptic_tape::HapticMemory;
use crate::rt::tissue::TissueLoop;
use crate::rt::wiring::{Capacities, Wiring};
use crate::rt::world::World;
use crate::start::needle_start;
use crate::stepped::HAPTIC_TICKS_PER_TISSUE_TICK;
use std::rc::Rc;
use std::sync::atomic::Ordering;
use stylet_hw::{Device, SimulatedPhantom, SimulatedPhantomConfig};
use stylet_shm_schema::{
    Command, CommandKind, HapticState, ParameterProblems, ParameterSet, SCHEMA_VERSION, Session, Text, ThreadReport,
    flags,
};
use stylet_sim::active::activate;
use stylet_sim::scene::{Scene, SceneError, SceneSource};
use stylet_sim::tissue::{TissueError, TissueSpec};

/// Most time that one step makes up for; the core stands still for the rest.
const MOST_BEHIND_NS: u64 = 100_000_000;
/// Ticks of the force loop between two passes of the control thread: 2 ms, as in a run.
const TICKS_PER_PASS: u64 = 2;
const ADVICE: &str = "This core is stepped by its window: no real time, and no device that renders the force.";

/// Failure to start; the text is for people.
#[derive(Debug, thiserror::Error)]
pub enum SteppedCoreError {
    /// There is no such scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Parameters that do not suit the device, one per line.
    #[error(transparent)]
    Parameters(#[from] ParameterProblems),
    /// The tissue model could not be set up.
    #[error(transparent)]
    World(#[from] TissueError),
    /// There is no memory for snapshots.
    #[error("no memory to show the scene in: {0}")]
    Board(#[from] std::io::Error),
}

/// The loops, the control thread, and the host's side of the desk between them.
pub struct SteppedCore {
    haptic: HapticLoop,
    tissue: TissueLoop,
    control: Control,
    desk: Rc<Desk>,
    /// Time of the newest tick, ns.
    now_ns: u64,
    ticks: u64,
    lost_ns: u64,
    /// Renewal that stands until the end of this step: a host that steps its core is there meanwhile.
    renewal: Option<Command>,
}

impl SteppedCore {
    /// Begins with a built-in scene at `now_ns` of the caller's clock.
    pub fn new(scene: &str, tissue: impl Into<TissueSpec>, now_ns: u64) -> Result<Self, SteppedCoreError> {
        let tissue = tissue.into();
        let source = SceneSource::Builtin(scene.to_owned());
        let scene = Scene::builtin(scene)?;
        let device = SimulatedPhantom::new(SimulatedPhantomConfig {
            start_tip_in_world: needle_start(&scene),
            ..SimulatedPhantomConfig::default()
        });
        let info = device.info();
        let active = activate(&ParameterSet::default(), &info)?;
        let session_id = now_ns.max(1);
        let mut world = Box::new(World::new(scene, tissue, active.limits, 1)?);
        let desk = Rc::<Desk>::default();
        desk.now_ns.set(now_ns);
        let mut wall = Here::at(Rc::clone(&desk));
        world.shown = Some(wall.make_board(snapshot_len(&world.scene))?);
        let base_flags = if tissue.has_lines() { flags::LINE_NEEDED } else { 0 };
        let memory = HapticMemory::new(&info, (active.needle, active.force), base_flags);
        let wiring = Wiring::new(Capacities::RUN, None, None);
        // SYNC: both sides are this thread.
        wiring.tissue.is_watched.store(true, Ordering::Relaxed);
        let picture = ScenePicture::first(&world.scene, session_id);
        let seconds = |ns: u64| ns as f64 / 1e9;
        let haptic = HapticLoop::new(
            session_id,
            Box::new(device),
            wiring.haptic,
            &memory,
            seconds(HAPTIC_PERIOD_NS),
        );
        let setup = ControlSetup {
            device: info,
            session: session(session_id, now_ns, info.name),
            picture,
            tissue,
            source: source.into(),
            second: None,
            probe_folder: None,
            flights: None,
        };
        Ok(Self {
            haptic,
            tissue: TissueLoop::new(session_id, wiring.tissue, world, seconds(TISSUE_PERIOD_NS)),
            control: Control::new(Box::new(wall), wiring.control, wiring.tapes, setup),
            desk,
            now_ns,
            ticks: 0,
            lost_ns: 0,
            renewal: None,
        })
    }

    /// Takes a request; its answer follows after a later step.
    pub fn ask(&mut self, asked: Asked) {
        if let Asked::Command(command) = &asked
            && command.kind == CommandKind::KeepMoving as u32
        {
            self.renewal = Some(**command);
        }
        self.desk.asked.borrow_mut().push_back(asked);
    }

    /// Makes all ticks that are due at `now_ns` of a clock that never goes back, at most 100 ms of them.
    pub fn step(&mut self, now_ns: u64) {
        let behind_ns = now_ns.saturating_sub(self.lost_ns + self.now_ns);
        self.lost_ns += behind_ns.saturating_sub(MOST_BEHIND_NS);
        for _ in 0..behind_ns.min(MOST_BEHIND_NS) / HAPTIC_PERIOD_NS {
            self.tick();
        }
        self.renewal = None;
    }

    fn tick(&mut self) {
        self.now_ns += HAPTIC_PERIOD_NS;
        self.ticks += 1;
        self.haptic.tick(self.now_ns, self.now_ns, 0);
        if self.ticks.is_multiple_of(HAPTIC_TICKS_PER_TISSUE_TICK) {
            self.tissue.tick(self.now_ns);
        }
        if self.ticks.is_multiple_of(TICKS_PER_PASS) {
            self.desk.now_ns.set(self.now_ns);
            let renewal = self.renewal.map(Box::new).map(Asked::Command);
            self.desk.asked.borrow_mut().extend(renewal);
            // A request to end has no process to end, and no pass is without a tick.
            let _ = self.control.pass();
        }
    }

    /// Returns what was told since the last call, in its order; a new snapshot comes last.
    pub fn take(&mut self) -> Vec<Told> {
        self.desk.take()
    }

    /// Returns the state of the force loop after its newest tick.
    pub fn state(&self) -> &HapticState {
        &self.haptic.memory.state
    }

    /// Time by which the core is behind the caller's clock for good, ns: its steps took longer than their time.
    pub fn lost_ns(&self) -> u64 {
        self.lost_ns
    }
}

/// Returns the announcement of the run.
fn session(session_id: u64, now_ns: u64, device: &str) -> Session {
    let thread = ThreadReport {
        asked_core: u32::MAX,
        core: u32::MAX,
        ..ThreadReport::default()
    };
    Session {
        session_id,
        schema_version: SCHEMA_VERSION,
        started_ns: now_ns,
        period_ns: HAPTIC_PERIOD_NS,
        tissue_period_ns: TISSUE_PERIOD_NS,
        haptic: thread,
        tissue: thread,
        no_rt_asked: 1,
        device: Text::new(device),
        version: Text::new(env!("CARGO_PKG_VERSION")),
        advice: Text::new(ADVICE),
        ..Session::default()
    }
}

#[cfg(test)]
mod tests;
