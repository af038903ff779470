//! One measurement: the run's own loops and bridge, a host, a load, and two threads that watch the machine.

use crate::collect::{LoopTiming, Plan};
use crate::gaps::{self, GapReport, Look, SPIN_NS};
use crate::host::{Host, HostError, HostReport, Script};
use crate::load::{Load, LoadError, Running};
use crate::machine::Machine;
use crate::noise::{self, Noise};
use crate::others::{self, Others};
use crate::paired::{self, Paired};
use crate::sample::WARM_UP_S;
use crate::trace::{self, TraceSection, Watched};
use crate::watch::{self, CoreWatch};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;
use stylet_runtime::process::{self, LoopReport, Options, RunError, RunReport};
use stylet_runtime::rt::arm::Usage;
use stylet_runtime::rt::clock::{HAPTIC_PERIOD_NS, TISSUE_PERIOD_NS};
use stylet_runtime::rt::haptic::HAPTIC_STAGES;
use stylet_runtime::rt::pin::{Pin, PinError};
use stylet_runtime::rt::second::SECOND_STAGES;
use stylet_runtime::rt::timing::{PoseTimes, Probe, Probes};
use stylet_runtime::rt::tissue::TISSUE_STAGES;
use stylet_sim::scene::{Scene, SceneError};

/// Most windows of a report, none shorter than 100 ms.
const WINDOWS: u64 = 240;
const SHORTEST_WINDOW_NS: u64 = 100_000_000;
/// Below both loops, above everything of normal priority.
const WATCH_PRIORITY_BELOW_TISSUE: u32 = 10;

/// Name of the force loop's thread.
const FORCE_THREAD: &str = "haptic";

/// Settings of a run.
pub struct Setup<'a> {
    pub options: &'a Options,
    pub duration_ns: u64,
    pub load: Load,
    /// Folder that the io load may write to.
    pub folder: &'a Path,
    /// A trace of the kernel names the causes of ticks that are later than this.
    pub trace_over_ns: Option<u64>,
    /// Checkpoints that receive the samples gathered so far during the run.
    pub checkpoints: Option<&'a Checkpoints<'a>>,
    /// Pin that the force loop toggles for an instrument.
    pub toggle: Option<Pin>,
    /// A witness keeps watch beside the force loop.
    pub witness: bool,
    /// The force loop's core is watched before the loop starts.
    pub noise: bool,
}

impl<'a> Setup<'a> {
    /// Makes a run without trace, checkpoints, pin, witness and noise pass.
    pub fn new(options: &'a Options, duration_ns: u64, load: Load, folder: &'a Path) -> Self {
        Self {
            options,
            duration_ns,
            load,
            folder,
            trace_over_ns: None,
            checkpoints: None,
            toggle: None,
            witness: false,
            noise: false,
        }
    }
}

/// Checkpoints of a long run; the names of the loops are `force` and `tissue`.
pub struct Checkpoints<'a> {
    pub every: Duration,
    /// Length of the windows whose maxima are kept.
    pub window_ns: u64,
    pub take: &'a (dyn Fn(&'static str, &LoopTiming) + Sync),
}

/// Capacity of the ring to the gathering thread, in time.
const RING_NS: u64 = 4_000_000_000;

/// Reason why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// The scene cannot be built.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The load does not start, or ended by itself.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The loops did not run.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The host saw no tick.
    #[error(transparent)]
    Host(#[from] HostError),
    /// The pin for an instrument cannot be used.
    #[error(transparent)]
    Pin(#[from] PinError),
    /// A thread of the measurement ended early.
    #[error("a measuring thread panicked")]
    Panicked,
}

/// Results of one measurement.
pub struct Measured {
    pub run: RunReport,
    pub haptic: LoopTiming,
    pub tissue: LoopTiming,
    /// The loop of the second device, if the run has one.
    pub second: Option<LoopTiming>,
    pub host: HostReport,
    pub gaps: GapReport,
    pub noise: Option<Noise>,
    pub cores: Vec<CoreWatch>,
    pub others: Others,
    pub paired: Option<Paired>,
    pub trace: Option<TraceSection>,
    pub window_ns: u64,
    /// When it began, whole seconds since 1970.
    pub began_s: u64,
}

/// Counters of one loop, from arming to its end.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct LoopCounts {
    pub ticks: u64,
    pub missed_deadlines: u64,
    pub overruns: u64,
    /// Ticks that the measurement itself lost.
    pub unmeasured: u64,
    #[serde(flatten)]
    pub usage: Usage,
    pub voluntary_switches_beyond_sleep: i64,
}

/// Returns the voluntary switches beyond one for each sleep.
fn switches_beyond_sleep(report: &LoopReport) -> i64 {
    (report.usage.voluntary_switches - report.sleeps as i64).max(0)
}

/// Returns the counters of a loop.
pub fn counts(run: &LoopReport, timing: &LoopTiming) -> LoopCounts {
    LoopCounts {
        ticks: run.ticks,
        missed_deadlines: timing.missed,
        overruns: timing.overruns,
        unmeasured: timing.lost,
        usage: run.usage,
        voluntary_switches_beyond_sleep: switches_beyond_sleep(run),
    }
}

pub fn window_ns(duration_ns: u64) -> u64 {
    (duration_ns / WINDOWS).max(SHORTEST_WINDOW_NS)
}

fn warm_up_ticks(period_ns: u64) -> u64 {
    (WARM_UP_S * 1e9) as u64 / period_ns
}

fn plan(period_ns: u64, duration_ns: u64, window_ns: u64) -> Plan {
    Plan {
        period_ns,
        warm_up_ticks: warm_up_ticks(period_ns),
        window_ns,
        windows: (duration_ns / window_ns + 1) as usize,
        grid: duration_ns / period_ns,
    }
}

/// Returns a core for the gap watch: one without a loop, else that of the tissue loop.
fn watch_core(options: &Options) -> Option<usize> {
    let cores = core_affinity::get_core_ids().unwrap_or_default();
    let free = cores.iter().map(|c| c.id).find(|&id| {
        let second = options.second.as_ref().and_then(|second| second.core);
        ![options.haptic_core, options.tissue_core, second].contains(&Some(id))
    });
    free.or(options.tissue_core)
}

/// Runs for `setup.duration_ns` after the first tick that a host saw, or until `interrupted`.
pub fn measure(setup: &Setup, interrupted: &AtomicBool) -> Result<Measured, MeasureError> {
    process::limits::check().map_err(RunError::from)?;
    let machine = Machine::this();
    let pass = || noise::pass(&machine, setup.options, setup.duration_ns, interrupted).ok_or(MeasureError::Panicked);
    let noise = setup.noise.then(pass).transpose()?;
    let began_s = jiff::Timestamp::now().as_second().max(0) as u64;
    let script = Script::of(&Scene::builtin(&setup.options.scene)?);
    let pose_times = Arc::new(PoseTimes::default());
    let options = setup.options;
    let ring = |period_ns| rtrb::RingBuffer::new((RING_NS / period_ns) as usize);
    let (haptic_in, haptic_ring) = ring(options.haptic_period_ns);
    let (tissue_in, tissue_ring) = ring(TISSUE_PERIOD_NS);
    let (second_in, second_ring) = options.second.as_ref().map(|second| ring(second.period_ns)).unzip();
    // The loops' threads are started by this one and inherit the right to the pin.
    let toggle = setup.toggle.map(Pin::acquire).transpose()?;
    let probes = Probes {
        haptic: Probe::new(haptic_in, Arc::clone(&pose_times)).with_toggle(toggle),
        tissue: Probe::new(tissue_in, Arc::clone(&pose_times)),
        second: second_in.map(|into| Probe::new(into, Arc::clone(&pose_times))),
    };
    let window_ns = setup
        .checkpoints
        .map_or_else(|| window_ns(setup.duration_ns), |c| c.window_ns);
    let mut haptic = LoopTiming::new(
        HAPTIC_STAGES,
        plan(options.haptic_period_ns, setup.duration_ns, window_ns),
    );
    let tissue = LoopTiming::new(TISSUE_STAGES, plan(TISSUE_PERIOD_NS, setup.duration_ns, window_ns));
    let second = options.second.as_ref().zip(second_ring).map(|(second, ring)| {
        let plan = plan(second.period_ns, setup.duration_ns, window_ns);
        (LoopTiming::new(SECOND_STAGES, plan), ring)
    });
    let priority = (!options.no_rt).then(|| {
        options
            .tissue_priority
            .saturating_sub(WATCH_PRIORITY_BELOW_TISSUE)
            .max(1)
    });
    // On a single core it would starve the bridge and the host.
    let priority = priority.filter(|_| watch_core(options) != options.haptic_core);
    let second_core = options.second.as_ref().and_then(|second| second.core);
    let second_core = second_core.filter(|&core| ![options.haptic_core, options.tissue_core].contains(&Some(core)));
    let (core, watched) = (
        watch_core(options),
        [options.haptic_core, options.tissue_core, second_core],
    );
    let stop = Arc::new(AtomicBool::new(false));
    let before = others::before(&machine);
    let mut load = Running::start(setup.load, &options.instance, setup.folder)?;
    let traced = setup.trace_over_ns.zip(options.haptic_core);
    let tracing = traced.map(|(over_ns, core)| Watched {
        machine: &machine,
        core,
        thread: FORCE_THREAD,
        priority: (!options.no_rt).then_some(options.haptic_priority),
        over_ns,
    });
    let instance = tracing.as_ref().map(|_| trace::Instance::start());
    let (run, host, gaps, cores, others, paired, trace, haptic, tissue, second) = std::thread::scope(|threads| {
        let stop = &stop;
        let trace = tracing
            .as_ref()
            .zip(instance)
            .map(|(watched, instance)| match instance {
                Ok(instance) => {
                    let (into, late) = mpsc::channel();
                    haptic.report_late(watched.over_ns, into);
                    Ok(threads.spawn(move || trace::watch(instance, watched, &late)))
                }
                Err(why) => Err(TraceSection::absent(watched.over_ns, &why)),
            });
        let host = threads.spawn(|| {
            let warm_up = warm_up_ticks(options.haptic_period_ns);
            let host = Host::new(&options.instance, script, pose_times, warm_up, options.second.is_some());
            // SYNC: set by a signal handler; nothing but the flag is carried.
            let report = host.and_then(|h| h.run(setup.duration_ns, || interrupted.load(Ordering::Acquire), stop));
            // SYNC: pairs with the acquire loads of bridge and watches; nothing but the flag is carried.
            stop.store(true, Ordering::Release);
            report
        });
        let gathered = |timing: LoopTiming, ring, name| match setup.checkpoints {
            Some(c) => timing.gather_with(ring, c.every, |so_far| (c.take)(name, so_far)),
            None => timing.gather(ring),
        };
        let haptic = threads.spawn(move || gathered(haptic, haptic_ring, "force"));
        let tissue = threads.spawn(move || gathered(tissue, tissue_ring, "tissue"));
        // A campaign keeps the two loops present in every run.
        let second = second.map(|(timing, ring)| threads.spawn(move || timing.gather(ring)));
        let gaps = threads.spawn(move || {
            let look = Look {
                core,
                priority,
                spin_ns: SPIN_NS,
            };
            // SYNC: nothing but the flag is carried.
            gaps::watch(look, || stop.load(Ordering::Acquire))
        });
        let machine = &machine;
        let looked_at = others::Watched {
            core: options.haptic_core,
            priority: if options.no_rt { 1 } else { options.haptic_priority },
            thread: FORCE_THREAD,
            from_core: core,
            low_priority: true,
        };
        let others = threads.spawn(move || others::watch(machine, looked_at, before, stop));
        let paired = setup
            .witness
            .then(|| threads.spawn(move || paired::watch(machine, options, FORCE_THREAD, stop)));
        let cores: Vec<_> = watched
            .into_iter()
            .flatten()
            .map(|core| threads.spawn(move || watch::watch(machine, core, stop)))
            .collect();
        let run = process::run_with(options, Some(probes), stop);
        stop.store(true, Ordering::Release);
        let cores: Vec<CoreWatch> = cores.into_iter().filter_map(|t| t.join().ok()).collect();
        let others = others.join();
        let paired = paired.map(|thread| thread.join());
        let (haptic, tissue) = (haptic.join(), tissue.join());
        let second = second.map(|thread| thread.join());
        // It ends when the force loop's gathering ends.
        let trace = trace.map(|started| started.map_or_else(Ok, |thread| thread.join()));
        (
            run,
            host.join(),
            gaps.join(),
            cores,
            others,
            paired,
            trace,
            haptic,
            tissue,
            second,
        )
    });
    let others = others.map(|looked| others::after(&machine, looked));
    // A window that could not open draws nothing.
    let loaded = load.ended();
    drop(load);
    options.instance.sweep();
    loaded?;
    let panicked = |_| MeasureError::Panicked;
    // The loops' error is more useful than the host's, which saw nothing.
    let run = run?;
    Ok(Measured {
        run,
        haptic: haptic.map_err(panicked)?,
        tissue: tissue.map_err(panicked)?,
        second: second.transpose().map_err(panicked)?,
        host: host.map_err(panicked)??,
        gaps: gaps.map_err(panicked)?,
        noise,
        cores,
        others: others.map_err(panicked)?,
        paired: paired.transpose().map_err(panicked)?.flatten(),
        trace: trace.transpose().map_err(panicked)?,
        window_ns,
        began_s,
    })
}

/// Returns the period of a loop at `rate_hz`.
pub fn period_ns(rate_hz: u32) -> u64 {
    HAPTIC_PERIOD_NS * 1_000 / u64::from(rate_hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_cover_the_run_and_are_few() {
        for duration_s in [1, 10, 60, 3_600] {
            let duration_ns = duration_s * 1_000_000_000;
            let plan = plan(1_000_000, duration_ns, window_ns(duration_ns));
            assert!(plan.windows as u64 * plan.window_ns >= duration_ns);
            assert!(plan.windows as u64 <= WINDOWS + 1);
        }
        assert_eq!(period_ns(5_000), 200_000);
    }

    #[test]
    fn a_switch_for_each_sleep_is_not_counted() {
        let report = |voluntary_switches, sleeps| LoopReport {
            ticks: 100,
            sleeps,
            usage: Usage {
                voluntary_switches,
                ..Usage::default()
            },
            ..LoopReport::default()
        };
        assert_eq!(switches_beyond_sleep(&report(98, 100)), 0);
        assert_eq!(switches_beyond_sleep(&report(100, 100)), 0);
        assert_eq!(switches_beyond_sleep(&report(103, 100)), 3);
        assert_eq!(switches_beyond_sleep(&report(203, 190)), 13);
    }
}
