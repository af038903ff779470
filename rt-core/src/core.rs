//! Puts the process together: session, scene, device, two armed threads, and the bridge on the calling thread.

use crate::active::activate;
use crate::bridge::ports::Ports;
use crate::bridge::{Bridge, LoopPorts, ScenePicture, SnapshotLoans};
use crate::rt::arm::{self, Armed, Ask, Usage};
use crate::rt::clock;
use crate::rt::exchange::{TipPose, TissueResponse};
use crate::rt::haptic::{HapticLoop, HapticPorts};
use crate::rt::tissue::{TissueLoop, TissuePorts};
use crate::rt::world::World;
use crate::scene::Scene;
use nalgebra::Vector3;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use stylet_hw::{Device, SimulatedPhantom, SimulatedPhantomConfig};
use stylet_shm_schema::service::{self, Instance, STATE_KEY};
use stylet_shm_schema::{HapticState, ParameterSet, Session, Text, ThreadReport, flags};

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
}

/// What a run was.
#[derive(Clone, Copy, Debug, Default)]
pub struct RunReport {
    pub haptic: LoopReport,
    pub tissue: LoopReport,
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

const HAPTIC_PERIOD_S: f64 = 1e-3;
const TISSUE_PERIOD_S: f64 = 5e-3;

/// Runs until `stop` is set by a signal, or a host asks to end. Errors are for people: they say what to do.
pub fn run(options: &Options, stop: &Arc<AtomicBool>) -> Result<RunReport, String> {
    let scene = Scene::builtin(&options.scene).map_err(|e| e.to_string())?;
    let device = device_for(&scene);
    let info = device.info();
    let active = activate(&ParameterSet::default(), &info).map_err(|p| p.join("\n"))?;
    let session_id = clock::now_ns() ^ (u64::from(std::process::id()) << 40);
    let picture = ScenePicture::first(&scene, session_id);
    let node = options.instance.node().map_err(|e| e.to_string())?;
    let ports =
        Ports::new(&node, scene.surface.vertex_elements.len(), picture.word_count()).map_err(|e| e.to_string())?;
    let world = Box::new(World::new(scene, active.limits, 1));
    let board = service::create_state_board(&node, session_id).map_err(|e| e.to_string())?;
    let locked = lock_memory(options)?;

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
    let haptic_ports = HapticPorts {
        pose: pose_in,
        response: response_out,
        orders: haptic_order_out,
        notices: haptic_notice_in,
        records: record_in,
    };
    let haptic = HapticLoop::new(
        session_id,
        device,
        haptic_ports,
        (active.needle, active.force),
        HAPTIC_PERIOD_S,
        real_time,
    );
    let tissue_ports = TissuePorts {
        pose: pose_out,
        response: response_in,
        orders: tissue_order_out,
        notices: tissue_notice_in,
        old_worlds: old_world_in,
        slots: slot_out,
        filled: filled_in,
    };
    let tissue = TissueLoop::new(session_id, tissue_ports, world, TISSUE_PERIOD_S);

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
        period_ns: (HAPTIC_PERIOD_S * 1e9) as u64,
        tissue_period_ns: (TISSUE_PERIOD_S * 1e9) as u64,
        haptic: haptic_report,
        tissue: tissue_report,
        memory_locked: u32::from(locked.is_none()),
        no_rt_asked: u32::from(options.no_rt_asked),
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
    };
    let mut bridge = Bridge::new(node, ports, loops, info, session, picture);
    // SYNC: set by a signal handler; nothing but the flag is carried.
    let served = bridge.run(|| stop.load(Ordering::Acquire)).map_err(|e| e.to_string());
    // SYNC: pairs with the acquire loads in both loops.
    end.store(true, Ordering::Release);
    let gone = |_| "a real-time thread ended by itself".to_owned();
    let haptic = haptic_thread.join().map_err(gone)?;
    let tissue = tissue_thread.join().map_err(gone)?;
    served.map(|()| RunReport { haptic, tissue })
}

/// The simulated hand starts outside the body, below its target.
fn device_for(scene: &Scene) -> Box<dyn Device> {
    let (lowest, _) = scene.lattice.bounds_m();
    let (lower, upper) = scene.target_bounds_m();
    let start = Vector3::new(
        (lower[0] + upper[0]) / 2.0,
        (lower[1] + upper[1]) / 2.0,
        lowest[2] - 0.03,
    );
    Box::new(SimulatedPhantom::new(SimulatedPhantomConfig {
        start_tip_in_world: start,
        ..SimulatedPhantomConfig::default()
    }))
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
fn spawn<R: Send + 'static>(
    name: &str,
    ask: Ask,
    end: &Arc<AtomicBool>,
    body: impl FnOnce(&Armed, &AtomicBool) -> R + Send + 'static,
) -> Result<Started<R>, String>
where
    R: Default,
{
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
