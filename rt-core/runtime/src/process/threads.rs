//! Starts, arms and joins the real-time threads.

use super::{LoopReport, Options, RunError, RunReport};
use crate::rt::arm::{self, Armed, Ask, Usage};
use crate::rt::device_loop::{self, Counts, DeviceLoop};
use crate::rt::haptic::HapticLoop;
use crate::rt::second::SecondLoop;
use crate::rt::tissue::TissueLoop;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use stylet_shm_schema::{HapticState, SecondState, ThreadReport};
use stylet_wall::board::Writer;

/// A loop's thread, and its grants from the kernel.
struct Started {
    thread: JoinHandle<LoopReport>,
    granted: ThreadReport,
}

/// All real-time threads. The loops have their own end flag: the control thread must be able to end them on a host's
/// request.
pub(super) struct Threads {
    haptic: Started,
    tissue: Started,
    second: Option<Started>,
    end: Arc<AtomicBool>,
}

impl Threads {
    /// Starts and arms all threads; none runs if one is refused.
    pub fn start(
        options: &Options,
        (haptic, board): (HapticLoop, Writer<HapticState>),
        tissue: TissueLoop,
        second: Option<(SecondLoop, Writer<SecondState>)>,
    ) -> Result<Self, RunError> {
        let ask = |priority, core| Ask {
            priority: (!options.no_rt).then_some(priority),
            core,
        };
        let end = Arc::new(AtomicBool::new(false));
        let ended_by = |why: RunError| {
            // SYNC: pairs with the acquire load in the running loops.
            end.store(true, Ordering::Release);
            why
        };
        let tissue_ask = ask(options.tissue_priority, options.tissue_core);
        let tissue = spawn("tissue", tissue_ask, &end, |armed, end| run_tissue(tissue, armed, end))?;
        let second = second.zip(options.second.as_ref()).map(|((second, board), asked)| {
            spawn("second", ask(asked.priority, asked.core), &end, move |armed, end| {
                run_with_device(second, board, armed, end)
            })
        });
        let second = second.transpose().map_err(ended_by)?;
        let haptic_ask = ask(options.haptic_priority, options.haptic_core);
        let haptic = spawn("haptic", haptic_ask, &end, move |armed, end| {
            run_with_device(haptic, board, armed, end)
        })
        .map_err(ended_by)?;
        Ok(Self {
            haptic,
            tissue,
            second,
            end,
        })
    }

    /// Grants of the threads of force loop, tissue loop and second device.
    pub fn grants(&self) -> [ThreadReport; 3] {
        let second = self.second.as_ref().map(|second| second.granted);
        [self.haptic.granted, self.tissue.granted, second.unwrap_or_default()]
    }

    /// Asks all loops to end.
    pub fn end(&self) {
        // SYNC: pairs with the acquire loads in the loops.
        self.end.store(true, Ordering::Release);
    }

    /// Waits for all loops and returns their cost.
    pub fn join(self) -> Result<RunReport, RunError> {
        let join = |started: Started| started.thread.join().map_err(|_| RunError::ThreadEnded);
        Ok(RunReport {
            haptic: join(self.haptic)?,
            tissue: join(self.tissue)?,
            second: self.second.map(join).transpose()?,
            ..RunReport::default()
        })
    }
}

fn run_tissue(mut tissue: TissueLoop, armed: &Armed, end: &AtomicBool) -> LoopReport {
    let (start, sleeps) = (Usage::now(), tissue.run(armed, end));
    let r = tissue.response();
    let counts = Counts {
        ticks: r.tick,
        since_start: r.since_start,
        since_armed: r.since_armed,
    };
    report(armed, start, sleeps, counts)
}

fn run_with_device<L: DeviceLoop>(
    mut device_loop: L,
    mut board: Writer<L::State>,
    armed: &Armed,
    end: &AtomicBool,
) -> LoopReport {
    let mut publish = |state: &L::State| board.write(|shown, _| *shown = *state);
    publish(device_loop.state());
    let (start, sleeps) = (Usage::now(), device_loop::run(&mut device_loop, armed, end, publish));
    report(armed, start, sleeps, device_loop.counts())
}

fn report(armed: &Armed, start: Usage, sleeps: u64, counts: Counts) -> LoopReport {
    LoopReport {
        usage: Usage::now().since(start),
        thread: armed.report,
        ticks: counts.ticks,
        since_start: counts.since_start,
        since_armed: counts.since_armed,
        sleeps,
    }
}

/// Starts and arms a thread, and waits for its grants.
fn spawn(
    name: &'static str,
    ask: Ask,
    end: &Arc<AtomicBool>,
    body: impl FnOnce(&Armed, &AtomicBool) -> LoopReport + Send + 'static,
) -> Result<Started, RunError> {
    let (report, reported) = mpsc::channel();
    let end = Arc::clone(end);
    let thread = std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(move || match arm::arm(ask) {
            Ok(armed) => {
                let _ = report.send(Ok(armed.report));
                drop(report);
                body(&armed, &end)
            }
            Err(why) => {
                let _ = report.send(Err(why));
                LoopReport::default()
            }
        })
        .map_err(|why| RunError::Spawn { name, why })?;
    let granted = reported.recv().map_err(|_| RunError::EndedEarly(name))??;
    Ok(Started { thread, granted })
}
