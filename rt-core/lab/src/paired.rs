//! The paired witness: a thread that only sleeps, on the force loop's core, at its deadlines, one priority above it.
//!
//! Where it woke in time the core was free, so a late tick is the loop's own. Where both were late, the core was taken
//! from both: by the machine, or by a thread that nothing preempts.

use crate::collect::LateTick;
use crate::machine::Machine;
use crate::sample::{WARM_UP_S, histogram, late_from_ns};
use hdrhistogram::Histogram;
use std::io;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stylet_runtime::process::Options;
use stylet_runtime::rt::arm::{self, Ask};
use stylet_runtime::rt::clock::{self, HAPTIC_PHASE, phase_ns};

/// Most late wake-ups that are kept.
const KEPT: usize = 1 << 14;
/// Highest priority of `SCHED_FIFO`.
const HIGHEST: u32 = 99;

/// Wake-ups of the witness in one run.
#[derive(Clone)]
pub struct Paired {
    pub wake: Histogram<u64>,
    /// The first and the last deadline that it watched.
    watched_ns: [u64; 2],
    /// Deadline and lateness of its late wake-ups.
    late: Vec<(u64, u64)>,
}

impl Default for Paired {
    fn default() -> Self {
        Self {
            wake: histogram(),
            watched_ns: [u64::MAX, 0],
            late: Vec::with_capacity(KEPT),
        }
    }
}

impl Paired {
    /// Takes its wake-up for a deadline; one that is later than `late_ns` is kept.
    pub fn take(&mut self, due_ns: u64, wake_ns: u64, late_ns: u64) {
        if self.late.len() == KEPT {
            return;
        }
        self.wake.saturating_record(wake_ns);
        self.watched_ns = [self.watched_ns[0].min(due_ns), due_ns];
        if wake_ns >= late_ns {
            self.late.push((due_ns, wake_ns));
        }
    }

    /// Returns how late it was for a deadline, 0 if in time; `None` if it did not watch then. It may have slept through
    /// the deadline after an earlier one.
    fn lateness_ns(&self, due_ns: u64) -> Option<u64> {
        let [first_ns, last_ns] = self.watched_ns;
        (first_ns..=last_ns).contains(&due_ns).then(|| {
            let next = self.late.partition_point(|(due, _)| *due <= due_ns);
            let before = next.checked_sub(1).map(|i| self.late[i]);
            before.map_or(0, |(due, late_ns)| (due + late_ns).saturating_sub(due_ns))
        })
    }

    /// Sorts late wake-ups of the loop: those of the loop alone, for which this witness was less than half as late; and
    /// the others.
    pub fn sort(&self, late: &[LateTick]) -> [Histogram<u64>; 2] {
        let mut sorted = [histogram(), histogram()];
        for tick in late {
            if let Some(ns) = self.lateness_ns(tick.due_ns) {
                sorted[usize::from(2 * ns >= tick.wake_ns)].saturating_record(tick.wake_ns);
            }
        }
        sorted
    }

    /// Returns what it saw of a late tick, in words.
    pub fn words(&self, tick: &LateTick) -> Option<String> {
        let late_ns = self.lateness_ns(tick.due_ns)?;
        Some(if 2 * late_ns >= tick.wake_ns {
            let us = late_ns as f64 / 1e3;
            format!("the witness on the same core woke {us:.0} us late as well: not the loop alone")
        } else {
            "the witness on the same core woke in time: the loop alone".to_owned()
        })
    }
}

/// Watches the deadlines of the force loop, whose thread is called `thread`, until `stop`; `None` if the loop does not
/// start, or the kernel grants no higher priority.
pub fn watch(machine: &Machine, options: &Options, thread: &str, stop: &AtomicBool) -> Option<Paired> {
    let period_ns = options.haptic_period_ns;
    let mut paired = Paired::default();
    // Until then all other threads are moved off the loop's core.
    while machine.own_thread(thread).is_none() {
        // SYNC: nothing but the flag is carried.
        if stop.load(Ordering::Acquire) {
            return None;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let ask = Ask {
        priority: Some((options.haptic_priority + 1).min(HIGHEST)),
        core: options.haptic_core,
    };
    let _armed = arm::arm(ask).ok()?;
    let alarms = Alarms::new().ok()?;
    let early_ns = options.wait.early_ns;
    let grid = clock::Grid::at_phase(clock::now_ns(), period_ns, phase_ns(HAPTIC_PHASE, period_ns));
    // As the loop, it wakes early and again at the deadline; without an early wake-up both are one.
    let event_ns =
        |event: u64| grid.due_ns + event / 2 * period_ns - if event.is_multiple_of(2) { early_ns } else { 0 };
    let warm_ns = grid.due_ns + (WARM_UP_S * 1e9) as u64;
    // Half as late as the loop already counts.
    let late_ns = late_from_ns(period_ns) / 2;
    (0..2).for_each(|event| alarms.arm(event, event_ns(event)));
    let mut woke_ns = 0;
    for event in 0.. {
        // SYNC: nothing but the flag is carried.
        if stop.load(Ordering::Acquire) {
            break;
        }
        alarms.wait(event);
        let (due_ns, now_ns) = (event_ns(event), clock::now_ns());
        // As the loop, it skips deadlines that it has slept through.
        if event % 2 == 1 && due_ns >= warm_ns && due_ns > woke_ns {
            paired.take(due_ns, now_ns.saturating_sub(due_ns), late_ns);
        }
        woke_ns = if event % 2 == 1 { now_ns } else { woke_ns };
        alarms.arm(event + 2, event_ns(event + 2));
    }
    Some(paired)
}

/// Two timers for events by turns. That of the next event is armed before this one, so that the kernel programs nothing
/// between the wake-up of the witness and that of the loop: in a virtual machine that may take longer than all else.
struct Alarms([OwnedFd; 2]);

impl Alarms {
    fn new() -> io::Result<Self> {
        let timer = || {
            // SAFETY: no preconditions.
            let fd = unsafe { libc::timerfd_create(libc::CLOCK_MONOTONIC, libc::TFD_CLOEXEC) };
            if fd < 0 {
                return Err(io::Error::last_os_error());
            }
            // SAFETY: the descriptor was just made and has no other owner.
            Ok(unsafe { OwnedFd::from_raw_fd(fd) })
        };
        Ok(Self([timer()?, timer()?]))
    }

    fn arm(&self, event: u64, at_ns: u64) {
        let time = |ns: u64| libc::timespec {
            tv_sec: (ns / 1_000_000_000) as libc::time_t,
            tv_nsec: (ns % 1_000_000_000) as libc::c_long,
        };
        let at = libc::itimerspec {
            it_interval: time(0),
            it_value: time(at_ns),
        };
        let fd = self.0[event as usize % 2].as_raw_fd();
        // SAFETY: `at` is valid for reads; the old value is not asked for.
        unsafe { libc::timerfd_settime(fd, libc::TFD_TIMER_ABSTIME, &at, std::ptr::null_mut()) };
    }

    fn wait(&self, event: u64) {
        let mut expired = 0_u64;
        let fd = self.0[event as usize % 2].as_raw_fd();
        // SAFETY: eight bytes are valid for writes.
        unsafe { libc::read(fd, (&raw mut expired).cast(), size_of::<u64>()) };
    }
}

/// Names of the histograms in the raw data.
pub const WITNESS: &str = "paired/witness";
pub const LOOP_ALONE: &str = "paired/loop_alone";
pub const BOTH: &str = "paired/both";

#[cfg(test)]
mod tests {
    use super::*;

    fn tick(due_ns: u64, wake_ns: u64) -> LateTick {
        LateTick {
            due_ns,
            wake_ns,
            work_ns: 1_000,
        }
    }

    #[test]
    fn a_late_tick_is_the_loops_where_the_witness_was_in_time() {
        let mut paired = Paired::default();
        for (i, wake_ns) in [20_000, 400_000, 2_700_000, 10_000, 30_000].into_iter().enumerate() {
            // The third sleeps through two deadlines.
            let due_ns = 1_000_000 * [1, 2, 3, 6, 7][i];
            paired.take(due_ns, wake_ns, 100_000);
        }
        let late = [
            tick(1_000_000, 300_000),
            tick(2_000_000, 410_000),
            // The loop missed the third deadline and was late for the next.
            tick(4_000_000, 1_750_000),
            tick(7_000_000, 900_000),
            tick(8_000_000, 500_000),
        ];
        let [alone, both] = paired.sort(&late);
        let values = |h: &Histogram<u64>| h.iter_recorded().map(|b| b.count_at_value()).sum::<u64>();
        assert_eq!((values(&alone), values(&both)), (2, 2), "the last was not watched");
        assert!(alone.count_at(300_000) == 1 && alone.count_at(900_000) == 1);
        assert!(
            paired
                .words(&late[1])
                .is_some_and(|w| w.contains("400 us late as well"))
        );
        assert!(paired.words(&late[3]).is_some_and(|w| w.ends_with("the loop alone")));
        assert_eq!(paired.words(&late[4]), None);
    }
}
