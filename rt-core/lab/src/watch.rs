//! The kernel's counters of the cores during a measurement: frequency, steal time, busy share, interrupts by source,
//! firmware.

use crate::machine::Machine;
use crate::trace::{Counted, counters};
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Observations of one core over the run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct CoreWatch {
    pub core: usize,
    pub lowest_mhz: Option<f64>,
    pub highest_mhz: Option<f64>,
    /// Steal time from `/proc/stat`, s; some hypervisors leave it at 0 whatever they take.
    pub steal_s: Option<f64>,
    pub interrupts: Option<u64>,
    /// Share of the run in which the core was busy, and of all time since the start of the PC before it.
    pub busy: Option<f64>,
    pub busy_before: Option<f64>,
    /// Interrupts by source, and throttling, the most frequent first.
    pub counted: Vec<Counted>,
    /// System management interrupts; `None` where they cannot be counted.
    pub system_management_interrupts: Option<u64>,
}

/// Reads the counters four times a second until `stop`.
pub fn watch(machine: &Machine, core: usize, stop: &AtomicBool) -> CoreWatch {
    let served = || machine.interrupts_served(core).into_values().reduce(|a, b| a + b);
    let count = || (machine.steal_s(core), served());
    let (steal_before, served_before) = count();
    let (busy_before, counters) = (machine.busy_of_all(core), counters::read(machine, core, 0));
    let mut seen = CoreWatch {
        core,
        ..CoreWatch::default()
    };
    // SYNC: nothing but the flag is carried.
    while !stop.load(Ordering::Acquire) {
        if let Some(mhz) = machine.frequency_mhz(core) {
            seen.lowest_mhz = Some(seen.lowest_mhz.map_or(mhz, |l| l.min(mhz)));
            seen.highest_mhz = Some(seen.highest_mhz.map_or(mhz, |h| h.max(mhz)));
        }
        std::thread::sleep(Duration::from_millis(250));
    }
    let share = |busy: u64, of: u64| (of > 0).then(|| busy as f64 / of as f64);
    let between = machine.busy_of_all(core).zip(busy_before);
    seen.busy = between.and_then(|(now, before)| share(now.0.saturating_sub(before.0), now.1.saturating_sub(before.1)));
    seen.busy_before = busy_before.and_then(|(busy, of)| share(busy, of));
    let now = counters::read(machine, core, 0);
    let counted = now.since(&counters).into_iter();
    seen.counted = counted.map(|(what, times)| Counted { what, times }).collect();
    seen.system_management_interrupts = now.smi_since(&counters);
    let (steal_after, served_after) = count();
    seen.steal_s = steal_after.zip(steal_before).map(|(a, b)| a - b);
    seen.interrupts = served_after.zip(served_before).map(|(a, b)| a.saturating_sub(b));
    seen
}
