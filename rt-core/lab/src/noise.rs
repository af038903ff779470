//! What takes the force loop's core before the loop starts: a thread of its priority spins there and reads the clock.

use crate::gaps::{self, GapReport, Look, PERIOD_NS};
use crate::machine::{Machine, longest_spin_ns};
use crate::others::{self, Others};
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use stylet_runtime::process::Options;
use stylet_runtime::rt::clock;

/// Name of the thread.
const THREAD: &str = "noise";
/// Names of its histograms.
pub const GAPS: &str = "noise/gaps";
pub const SWITCHED: &str = "noise/switched";
/// A tenth of the measurement, and no less and no more than this.
const SHORTEST_NS: u64 = 2_000_000_000;
const LONGEST_NS: u64 = 10_000_000_000;
/// Longest gaps that are named.
const NAMED: usize = 8;

/// Result of one pass.
pub struct Noise {
    pub seen: GapReport,
    others: Others,
    began_ns: u64,
}

/// A gap, and who had the core.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NoiseGap {
    pub at_s: f64,
    pub us: f64,
    pub cause: String,
}

/// Watches the force loop's core for a part of `duration_ns`, or until `interrupted`; `None` without a thread.
pub fn pass(machine: &Machine, options: &Options, duration_ns: u64, interrupted: &AtomicBool) -> Option<Noise> {
    let length = Duration::from_nanos((duration_ns / 10).clamp(SHORTEST_NS, LONGEST_NS));
    let look = Look {
        core: options.haptic_core,
        priority: (!options.no_rt).then_some(options.haptic_priority),
        spin_ns: longest_spin_ns(PERIOD_NS, machine.throttle()),
    };
    let watched = others::Watched {
        core: look.core,
        priority: look.priority.unwrap_or(1),
        thread: THREAD,
        from_core: options.tissue_core,
        low_priority: false,
    };
    let (before, stop) = (others::before(machine), AtomicBool::new(false));
    let (begin, began_ns) = (Instant::now(), clock::now_ns());
    std::thread::scope(|threads| {
        let others = threads.spawn(|| others::watch(machine, watched, before, &stop).1);
        // SYNC: set by a signal handler; nothing but the flag is carried.
        let is_over = || begin.elapsed() >= length || interrupted.load(Ordering::Acquire);
        let named = std::thread::Builder::new().name(THREAD.to_owned());
        let seen = named.spawn_scoped(threads, move || gaps::watch(look, is_over));
        let seen = seen.ok().and_then(|thread| thread.join().ok());
        // SYNC: nothing but the flag is carried.
        stop.store(true, Ordering::Release);
        let others = others.join().ok();
        Some(Noise {
            seen: seen?,
            others: others?,
            began_ns,
        })
    })
}

impl Noise {
    /// Returns the longest gaps of both kinds.
    pub fn longest(&self) -> Vec<NoiseGap> {
        let unswitched = |_, _| "no thread was switched: an interrupt, the firmware, or the machine below".to_owned();
        let switched = |begin_ns, end_ns| {
            let rival = self.others.rival(begin_ns, end_ns);
            rival.unwrap_or_else(|| "another thread had the core".to_owned())
        };
        let gap = |&(begin_ns, ns): &(u64, u64), cause: &dyn Fn(u64, u64) -> String| NoiseGap {
            at_s: begin_ns.saturating_sub(self.began_ns) as f64 / 1e9,
            us: self.seen.gaps.highest_equivalent(ns) as f64 / 1e3,
            cause: cause(begin_ns, begin_ns + ns),
        };
        let found = self.seen.found.iter().map(|found| gap(found, &unswitched));
        let mut all: Vec<NoiseGap> = found
            .chain(self.seen.found_switched.iter().map(|found| gap(found, &switched)))
            .collect();
        all.sort_by(|a, b| b.us.total_cmp(&a.us));
        all.truncate(NAMED);
        all
    }
}
