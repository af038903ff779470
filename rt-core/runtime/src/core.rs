//! Puts the process together: session, scene, device, two armed threads, and the bridge on the calling thread.

use crate::bridge::flight::FlightDesk;
use crate::bridge::ports::Ports;
use crate::bridge::{Bridge, LoopPorts, ScenePicture, SnapshotLoans};
use crate::device::{self, DeviceChoice};
use crate::replay::file::Flight;
use crate::rt::arm::{self, Armed, Ask, Usage};
use crate::rt::clock;
use crate::rt::exchange::{TipPose, TissueResponse};
use crate::rt::haptic::{HapticLoop, HapticPorts};
use crate::rt::haptic_tape::{HapticMemory, HapticTape};
use crate::rt::recorder::recorder;
use crate::rt::timing::Probes;
use crate::rt::tissue::{TissueLoop, TissuePorts};
use crate::rt::tissue_tape::TissueTape;
use crate::rt::world::World;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use stylet_hw::DeviceInfo;
use stylet_shm_schema::service::{self, Instance, STATE_KEY};
use stylet_shm_schema::{Fault, HapticState, ParameterSet, Session, Text, ThreadReport, flags};
use stylet_sim::active::activate;
use stylet_sim::scene::TissueKind;
use stylet_sim::scene::{Scene, SceneSource};

/// Records that the bridge may be late by: four seconds of them.
const RECORD_RING: usize = 4096;

/// What a run is asked to be.
#[derive(Clone, Debug)]
pub struct Options {
    pub instance: Instance,
    pub scene: String,
    /// Go on without real-time scheduling.
    pub no_rt: bool,
    /// The operator wanted it so.
    pub no_rt_asked: bool,
    /// Why real time was tried and not granted, and how to grant it.
    pub rights_missing: Option<String>,
    pub haptic_core: Option<usize>,
    pub tissue_core: Option<usize>,
    pub haptic_priority: u32,
    pub tissue_priority: u32,
    pub haptic_period_ns: u64,
    /// Spinning before each haptic deadline; 0 for none.
    pub spin_ns: u64,
    /// Where flight recordings go.
    pub flight_folder: PathBuf,
    /// Of every scene of the run.
    pub tissue: TissueKind,
    pub device: DeviceChoice,
    /// The driver of a Phantom; `None` tries its usual names.
    pub libhd: Option<PathBuf>,
}

/// What a run was.
#[derive(Clone, Copy, Debug, Default)]
pub struct RunReport {
    pub haptic: LoopReport,
    pub tissue: LoopReport,
    pub memory_locked: bool,
    /// What the kernel granted for the exit from core sleep states, as read back; `None` when it was not asked or refused.
    pub exit_latency_us: Option<i32>,
}

/// What one loop was, from arming to its end.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoopReport {
    pub thread: ThreadReport,
    pub ticks: u64,
    pub missed: u64,
    pub worst_wake_ns: u64,
    pub usage: Usage,
}

/// 1 kHz.
pub const HAPTIC_PERIOD_NS: u64 = 1_000_000;
/// 200 Hz.
pub const TISSUE_PERIOD_NS: u64 = 5_000_000;

/// Runs until `stop` is set by a signal, or a host asks to end. Errors are for people: they say what to do.
pub fn run(options: &Options, stop: &Arc<AtomicBool>) -> Result<RunReport, String> {
    run_with(options, None, stop)
}

/// The same run, with a probe in each loop.
pub fn run_with(options: &Options, probes: Option<Probes>, stop: &Arc<AtomicBool>) -> Result<RunReport, String> {
    let mut scene = Scene::builtin(&options.scene).map_err(|e| e.to_string())?;
    scene.tissue = options.tissue;
    let force_loop = Ask {
        priority: (!options.no_rt).then_some(options.haptic_priority),
        core: options.haptic_core,
    };
    // Its servo thread goes to the core of the tissue step, which can wait for it longer than the force loop can.
    let device = device::open(
        &options.device,
        options.libhd.clone(),
        &scene,
        force_loop,
        options.tissue_core,
    )?;
    let info = device.info();
    let active = activate(&ParameterSet::default(), &info).map_err(|p| p.to_string())?;
    let session_id = clock::now_ns() ^ (u64::from(std::process::id()) << 40);
    let picture = ScenePicture::first(&scene, session_id);
    let node = options.instance.node().map_err(|e| e.to_string())?;
    let ports = Ports::new(&node, picture.snapshot_size().total(), picture.word_count()).map_err(|e| e.to_string())?;
    let world = Box::new(World::new(scene, active.limits, 1)?);
    let source = Arc::new(SceneSource::Builtin(options.scene.clone()));
    let (tissue_flight, tissue_desk) = recorder(Box::new(TissueTape::new(&world, Arc::clone(&source))));
    let board = service::create_state_board(&node, session_id).map_err(|e| e.to_string())?;
    options.instance.secure_room().map_err(|e| e.to_string())?;
    let locked = lock_memory(options)?;
    let awake = (!options.no_rt).then(arm::keep_cores_awake).flatten();

    let (pose_in, pose_out) = triple_buffer::triple_buffer(&TipPose::default());
    let (response_in, response_out) = triple_buffer::triple_buffer(&TissueResponse::default());
    let (record_in, record_out) = rtrb::RingBuffer::new(RECORD_RING);
    let (haptic_order_in, haptic_order_out) = rtrb::RingBuffer::new(256);
    let (haptic_notice_in, haptic_notice_out) = rtrb::RingBuffer::new(1024);
    let (tissue_order_in, tissue_order_out) = rtrb::RingBuffer::new(256);
    let (tissue_notice_in, tissue_notice_out) = rtrb::RingBuffer::new(1024);
    let (old_world_in, old_world_out) = rtrb::RingBuffer::new(8);
    let (slot_in, slot_out) = rtrb::RingBuffer::new(32);
    let (filled_in, filled_out) = rtrb::RingBuffer::new(32);

    let ask = |priority, core| Ask {
        priority: (!options.no_rt).then_some(priority),
        core,
    };
    let real_time = if options.no_rt { 0 } else { flags::REAL_TIME };
    // The loops have a flag of their own: the bridge must be able to end them when a host asks.
    let end = Arc::new(AtomicBool::new(false));
    let memory = HapticMemory::new(&info, (active.needle, active.force), real_time);
    let (haptic_flight, haptic_desk) = recorder(Box::new(HapticTape::new(&memory)));
    let haptic_ports = HapticPorts {
        pose: pose_in,
        response: response_out,
        orders: haptic_order_out,
        notices: haptic_notice_in,
        records: record_in,
        flight: haptic_flight,
    };
    let mut haptic = HapticLoop::new(
        session_id,
        device,
        haptic_ports,
        &memory,
        options.haptic_period_ns as f64 / 1e9,
    );
    haptic.spin_ns = options.spin_ns;
    let tissue_ports = TissuePorts {
        pose: pose_out,
        response: response_in,
        orders: tissue_order_out,
        notices: tissue_notice_in,
        old_worlds: old_world_in,
        slots: slot_out,
        filled: filled_in,
        flight: tissue_flight,
    };
    let mut tissue = TissueLoop::new(session_id, tissue_ports, world, TISSUE_PERIOD_NS as f64 / 1e9);
    if let Some(probes) = probes {
        haptic.probe = Some(Box::new(probes.haptic));
        tissue.probe = Some(Box::new(probes.tissue));
    }

    let tissue_thread = spawn(
        "tissue",
        ask(options.tissue_priority, options.tissue_core),
        &end,
        move |armed, stop| {
            let mut tissue = tissue;
            let start = Usage::now();
            tissue.run(armed, stop);
            let usage = Usage::now().since(start);
            let r = *tissue.response();
            LoopReport {
                thread: armed.report,
                ticks: r.tick,
                missed: r.missed,
                worst_wake_ns: r.worst_wake_ns,
                usage,
            }
        },
    );
    let haptic_thread = spawn(
        "haptic",
        ask(options.haptic_priority, options.haptic_core),
        &end,
        move |armed, stop| {
            let mut haptic = haptic;
            // The entry is made in the thread that uses it; making it allocates, so it comes before the loop.
            let writer = board
                .writer_builder()
                .create()
                .map_err(|e| format!("state board: {e:?}"));
            let entry = writer.and_then(|w| {
                w.entry::<HapticState>(&STATE_KEY)
                    .map(|e| (w, e))
                    .map_err(|e| format!("state board: {e:?}"))
            });
            let publish = |state: &HapticState| {
                if let Ok((_, entry)) = &entry {
                    entry.update_with_copy(*state);
                }
            };
            publish(&haptic.state);
            let start = Usage::now();
            haptic.run(armed, stop, publish);
            let usage = Usage::now().since(start);
            let s = &haptic.state;
            LoopReport {
                thread: armed.report,
                ticks: s.tick,
                missed: s.missed_deadlines,
                worst_wake_ns: s.worst_wake_ns,
                usage,
            }
        },
    );
    let threads = match (tissue_thread, haptic_thread) {
        (Ok(tissue), Ok(haptic)) => Ok((tissue, haptic)),
        (Err(why), _) | (_, Err(why)) => Err(why),
    };
    let ((tissue_thread, tissue_report), (haptic_thread, haptic_report)) = match threads {
        Ok(threads) => threads,
        Err(why) => {
            end.store(true, Ordering::Release);
            return Err(why);
        }
    };

    let session = Session {
        session_id,
        schema_version: stylet_shm_schema::SCHEMA_VERSION,
        pid: std::process::id(),
        time_ns: 0,
        started_ns: clock::now_ns(),
        period_ns: options.haptic_period_ns,
        tissue_period_ns: TISSUE_PERIOD_NS,
        haptic: haptic_report,
        tissue: tissue_report,
        memory_locked: u32::from(locked.is_none()),
        no_rt_asked: u32::from(options.no_rt_asked),
        refused: 0,
        device: Text::new(info.name),
        version: Text::new(env!("CARGO_PKG_VERSION")),
        advice: Text::new(&missing_rights(options, locked.as_deref())),
    };
    let loops = LoopPorts {
        records: record_out,
        haptic_orders: haptic_order_in,
        haptic_notices: haptic_notice_out,
        tissue_orders: tissue_order_in,
        tissue_notices: tissue_notice_out,
        old_worlds: old_world_out,
        loans: SnapshotLoans::new(slot_in, filled_out),
        flight: FlightDesk::new(
            haptic_desk,
            tissue_desk,
            options.flight_folder.clone(),
            flight_of(&info, session_id, options.haptic_period_ns),
        ),
    };
    let mut bridge = Bridge::new(node, ports, loops, info, session, picture, (options.tissue, source));
    // SYNC: set by a signal handler; nothing but the flag is carried.
    let served = bridge.run(|| stop.load(Ordering::Acquire));
    // SYNC: pairs with the acquire loads in both loops.
    end.store(true, Ordering::Release);
    if served.is_err() {
        // Not joined: a loop that stands still would be waited for in vain.
        return Err(Fault::LoopStopped.message().to_owned());
    }
    let gone = |_| "a real-time thread ended by itself".to_owned();
    let haptic = haptic_thread.join().map_err(gone)?;
    let tissue = tissue_thread.join().map_err(gone)?;
    if let Err(why) = bridge.save_last_flight() {
        eprintln!("rt-core: the flight recording was not saved: {why}");
    }
    Ok(RunReport {
        haptic,
        tissue,
        memory_locked: locked.is_none(),
        exit_latency_us: awake.map(|a| a.exit_latency_us),
    })
}

/// What every flight recording of this run says.
fn flight_of(device: &DeviceInfo, session_id: u64, haptic_period_ns: u64) -> Flight {
    Flight {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        session_id,
        reason: String::new(),
        device_name: device.name.to_owned(),
        device: device.into(),
        haptic_period_s: haptic_period_ns as f64 / 1e9,
        tissue_period_s: TISSUE_PERIOD_NS as f64 / 1e9,
        haptic: None,
        tissue: None,
    }
}

/// `None` when memory is locked; else what is missing, which only `--no-rt` accepts.
fn lock_memory(options: &Options) -> Result<Option<String>, String> {
    match arm::lock_memory() {
        Ok(()) => Ok(None),
        Err(why) if options.no_rt => Ok(Some(why.to_string())),
        Err(why) => Err(format!(
            "{why}\nOr start with --no-rt to run without real-time scheduling."
        )),
    }
}

fn missing_rights(options: &Options, unlocked: Option<&str>) -> String {
    match (&options.rights_missing, unlocked) {
        (Some(why), _) => why.clone(),
        (None, Some(why)) => why.to_owned(),
        (None, None) if !options.no_rt => String::new(),
        (None, None) => "started with --no-rt: real-time scheduling was not asked for. Restart without it".to_owned(),
    }
}

type Started<R> = (JoinHandle<R>, ThreadReport);

/// Starts a thread, arms it, and waits until it says what it got.
fn spawn<R: Default + Send + 'static>(
    name: &str,
    ask: Ask,
    end: &Arc<AtomicBool>,
    body: impl FnOnce(&Armed, &AtomicBool) -> R + Send + 'static,
) -> Result<Started<R>, String> {
    let (tell, told) = mpsc::channel();
    let end = Arc::clone(end);
    let thread = std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(move || match arm::arm(ask) {
            Ok(armed) => {
                let _ = tell.send(Ok(armed.report));
                drop(tell);
                body(&armed, &end)
            }
            Err(why) => {
                let _ = tell.send(Err(why.to_string()));
                R::default()
            }
        })
        .map_err(|e| format!("cannot start the {name} thread: {e}"))?;
    let report = told
        .recv()
        .map_err(|_| format!("the {name} thread ended before it began"))?;
    report
        .map(|report| (thread, report))
        .map_err(|why| format!("{why}\nOr start with --no-rt to run without real-time scheduling."))
}
