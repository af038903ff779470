//! Assembles the process: scene and device, shared memory, two armed threads, and the control thread on the calling
//! thread.

pub mod limits;
mod session;
mod setup;
mod threads;

use crate::background;
use crate::control::{BridgeError, Control, ControlSetup, LOOP_ENDED};
use crate::device::{DeviceChoice, DeviceError, Libraries};
use crate::rt::arm::{Refused, Usage};
use crate::rt::clock::Wait;
use crate::rt::timing::Probes;
use setup::Setup;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stylet_shm_schema::{DeadlineTotals, Instance, InstanceError, ParameterProblems, ThreadReport, affinity};
use stylet_sim::scene::SceneError;
use stylet_sim::tissue::{TissueError, TissueSpec};
use threads::Threads;

/// Settings of a run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Name under which hosts find the run.
    pub instance: Instance,
    /// Built-in scene to start with.
    pub scene: String,
    /// Run without real-time scheduling.
    pub no_rt: bool,
    /// The operator asked for `no_rt`.
    pub no_rt_asked: bool,
    /// Why real time was not granted, and how to grant it.
    pub rights_missing: Option<String>,
    /// Processor of the force loop; `None` for any.
    pub haptic_core: Option<usize>,
    /// Processor of the tissue loop; `None` for any.
    pub tissue_core: Option<usize>,
    /// `SCHED_FIFO` priority of the force loop.
    pub haptic_priority: u32,
    /// `SCHED_FIFO` priority of the tissue loop.
    pub tissue_priority: u32,
    /// Time between two ticks of the force loop, ns.
    pub haptic_period_ns: u64,
    /// Wait of the force loop for each deadline.
    pub wait: Wait,
    /// Folder of the flight recordings.
    pub flight_folder: PathBuf,
    /// Folder of the saved probe answers.
    pub probe_folder: Option<PathBuf>,
    /// Tissue model of every scene of the run.
    pub tissue: TissueSpec,
    /// Haptic device.
    pub device: DeviceChoice,
    /// The device of the other hand.
    pub second: Option<SecondOptions>,
    /// Vendor libraries.
    pub libraries: Libraries,
}

/// The second device, and the thread of its loop.
#[derive(Clone, Debug, PartialEq)]
pub struct SecondOptions {
    /// Haptic device.
    pub device: DeviceChoice,
    /// Time between two ticks of its loop, ns.
    pub period_ns: u64,
    /// Processor of its loop; `None` for any.
    pub core: Option<usize>,
    /// `SCHED_FIFO` priority of its loop.
    pub priority: u32,
}

/// Cost of a run.
#[derive(Clone, Copy, Debug, Default)]
pub struct RunReport {
    /// The force loop.
    pub haptic: LoopReport,
    /// The tissue loop.
    pub tissue: LoopReport,
    /// The loop of the second device.
    pub second: Option<LoopReport>,
    /// All memory of the process was locked.
    pub memory_locked: bool,
    /// Longest exit from a core's sleep state that the kernel allows, as read back, µs; `None` if not requested or
    /// refused.
    pub exit_latency_us: Option<i32>,
}

/// Cost of one loop, from arming to its end.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoopReport {
    /// Grants of the kernel to the thread.
    pub thread: ThreadReport,
    /// Ticks made.
    pub ticks: u64,
    /// Deadlines missed and worst wake-up.
    pub since_start: DeadlineTotals,
    /// Deadlines since the force was last turned on.
    pub since_armed: DeadlineTotals,
    /// Justified sleeps: each costs a context switch.
    pub sleeps: u64,
    /// Page faults, context switches and heap calls.
    pub usage: Usage,
}

/// Failure to start a run, or unexpected end of one. The texts are for people: they say what to do.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// There is no such scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The device could not be opened.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The second device could not be opened.
    #[error("--device-2: {0}")]
    SecondDevice(DeviceError),
    /// Both hands would hold one device.
    #[error(
        "--device and --device-2 name one device, or two that OpenHaptics would serve together, which is not built: name another for \
         --device-2, such as simulated"
    )]
    OneDeviceForBoth,
    /// Parameters that do not suit the device, one per line.
    #[error(transparent)]
    Parameters(#[from] ParameterProblems),
    /// The tissue model could not be set up.
    #[error(transparent)]
    World(#[from] TissueError),
    /// A limit of the PC is too low.
    #[error(transparent)]
    Limit(#[from] limits::LimitError),
    /// The folder in which hosts find the run cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The bridge did not start.
    #[error("the bridge to the hosts: {0}")]
    Bridge(#[from] BridgeError),
    /// Memory for the boards could not be allocated.
    #[error("no memory to show the run in: {0}")]
    Board(std::io::Error),
    /// Real time was requested and not granted.
    #[error("{0}\nOr start with --no-rt to run without real-time scheduling.")]
    NotGranted(#[from] Refused),
    /// The operating system could not start a thread.
    #[error("cannot start the {name} thread: {why}")]
    Spawn {
        /// Name of the loop.
        name: &'static str,
        /// Error of the operating system.
        why: std::io::Error,
    },
    /// A thread ended before its loop began.
    #[error("the {0} thread ended before it began")]
    EndedEarly(&'static str),
    /// The force loop stopped making ticks.
    #[error("{LOOP_ENDED}")]
    LoopStopped,
    /// A loop's thread ended unasked.
    #[error("a real-time thread ended by itself")]
    ThreadEnded,
}

/// Time for the running loops to hand over their tapes when the force loop has stopped: the device keeps its last force
/// until the process ends, or until its own watchdog acts.
const HAND_OVER_LIMIT: Duration = Duration::from_millis(100);

/// Runs until `stop` is set by a signal, or a host asks to end.
pub fn run(options: &Options, stop: &Arc<AtomicBool>) -> Result<RunReport, RunError> {
    run_with(options, None, stop)
}

/// As [`run`], with a probe in each loop.
pub fn run_with(options: &Options, probes: Option<Probes>, stop: &Arc<AtomicBool>) -> Result<RunReport, RunError> {
    limits::check()?;
    options.instance.sweep_dead();
    let owned = options.instance.own()?;
    if let Some(core) = options.haptic_core {
        // Later threads and processes stay off the core as well: the bridge and all background work.
        affinity::keep_off(core);
    }
    background::answer_first();
    let mut setup = Setup::new(options)?;
    let kernel = setup::lock_memory(options)?;
    let (session_id, info, second_info) = (setup.session_id, setup.info, setup.second_info);
    let is_watched = Arc::default();
    let (wall, (state, second_state)) = setup.show(owned, &is_watched)?;
    let loops = setup
        .bodies
        .into_loops(options, session_id, &setup.source, probes, &is_watched);
    let (second, second_ports) = loops.second.unzip();
    let second = second.zip(second_state);
    let threads = Threads::start(options, (loops.haptic, state), loops.tissue, second)?;
    let devices = (&info, second_info.as_ref());
    let session = session::session(options, session_id, devices, &threads, kernel.unlocked.as_deref());
    let mut control = Control::new(
        Box::new(wall),
        loops.control,
        loops.tapes,
        ControlSetup {
            device: info,
            session,
            picture: setup.picture,
            tissue: options.tissue,
            source: setup.source,
            second: second_info.zip(second_ports),
            probe_folder: options.probe_folder.clone(),
            flights: Some((
                options.flight_folder.clone(),
                session::flight(options, session_id, devices),
            )),
        },
    );
    // SYNC: set by a signal handler; nothing but the flag is carried.
    let served = control.run(|| stop.load(Ordering::Acquire));
    threads.end();
    if served.is_err() {
        // Not joined: a stopped loop would never be joined.
        match control.save_flight_of_stopped(HAND_OVER_LIMIT) {
            Ok(path) => eprintln!("rt-core: flight recording {}", path.display()),
            Err(why) => eprintln!("rt-core: the flight recording was not saved: {why}"),
        }
        return Err(RunError::LoopStopped);
    }
    let ended = threads.join()?;
    if let Err(why) = control.save_last_flight() {
        eprintln!("rt-core: the flight recording was not saved: {why}");
    }
    Ok(RunReport {
        memory_locked: kernel.unlocked.is_none(),
        exit_latency_us: kernel.awake.map(|a| a.exit_latency_us),
        ..ended
    })
}
