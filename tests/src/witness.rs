//! Whether the machine itself stood still: on each core a thread above every loop, which sleeps two milliseconds at a time.
//!
//! A hypervisor that takes a core away for 100 ms raises the fault that it should, whatever the program does. Such a time says
//! nothing about what a test asks, and it is not judged.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Twenty deadlines missed in a row are a fault; a stall of fewer is the program's to bear.
pub const STALL: Duration = Duration::from_millis(15);

const SLEEP: Duration = Duration::from_millis(2);
const PRIORITY: libc::c_int = 98;
const ATTEMPTS: usize = 3;

#[derive(Default)]
struct Seen {
    is_over: AtomicBool,
    longest_ns: AtomicU64,
}

/// Watches every core until dropped.
pub struct Witness {
    seen: Arc<Seen>,
    threads: Vec<JoinHandle<()>>,
}

impl Witness {
    pub fn begin() -> Self {
        let seen = Arc::new(Seen::default());
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
        let thread = |core| {
            let seen = seen.clone();
            std::thread::spawn(move || watch(core, &seen))
        };
        let threads = (0..cores).map(thread).collect();
        Self { seen, threads }
    }

    /// The longest time that a core ran nothing of the highest priority, since the last call.
    pub fn longest_stall(&self) -> Duration {
        Duration::from_nanos(self.seen.longest_ns.swap(0, Ordering::Relaxed))
    }
}

impl Drop for Witness {
    fn drop(&mut self) {
        self.seen.is_over.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// Without the rights for that priority it sees busy cores as well.
fn watch(core: usize, seen: &Seen) {
    let priority = libc::sched_param {
        sched_priority: PRIORITY,
    };
    // SAFETY: plain data of this thread; a refusal leaves it as it is.
    unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        libc::CPU_SET(core, &mut set);
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &set);
        libc::sched_setscheduler(0, libc::SCHED_FIFO, &priority);
    }
    while !seen.is_over.load(Ordering::Relaxed) {
        let begun = Instant::now();
        std::thread::sleep(SLEEP);
        let late = begun.elapsed().saturating_sub(SLEEP);
        seen.longest_ns.fetch_max(late.as_nanos() as u64, Ordering::Relaxed);
    }
}

/// Runs a check of what happens in time, and once more, up to twice, where it failed while the machine stood still.
pub fn where_the_machine_runs(check: impl Fn()) {
    for attempt in 1.. {
        let witness = Witness::begin();
        let Err(panic) = catch_unwind(AssertUnwindSafe(&check)) else {
            return;
        };
        let stall = witness.longest_stall();
        if stall < STALL || attempt == ATTEMPTS {
            println!("the longest stall of the machine was {stall:?}, in attempt {attempt}");
            resume_unwind(panic);
        }
        println!("a core stood still for {stall:?}: the check is repeated");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A failure on a machine that ran is a failure at once, and is not tried until it passes.
    #[test]
    fn a_failure_is_repeated_only_where_a_core_stood_still() {
        let (tries, stalls) = (AtomicU64::new(0), AtomicU64::new(0));
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            where_the_machine_runs(|| {
                // The machine may really stand still in this test: what was seen here counts.
                let witness = Witness::begin();
                std::thread::sleep(Duration::from_millis(20));
                tries.fetch_add(1, Ordering::Relaxed);
                let stalled = witness.longest_stall() > STALL / 2;
                stalls.fetch_add(u64::from(stalled), Ordering::Relaxed);
                panic!("on purpose");
            });
        }));
        assert!(outcome.is_err());
        let tries = tries.into_inner();
        assert!(tries == 1 || tries <= 1 + stalls.into_inner(), "{tries} tries");
    }

    /// A rival of a higher priority on one core is what a hypervisor looks like from inside.
    #[test]
    fn a_core_that_ran_nothing_is_seen() {
        let witness = Witness::begin();
        std::thread::sleep(Duration::from_millis(20));
        witness.longest_stall();
        let rival = std::thread::spawn(|| {
            let priority = libc::sched_param { sched_priority: 99 };
            // SAFETY: plain data of this thread.
            let granted = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &priority) } == 0;
            let begun = Instant::now();
            while granted && begun.elapsed() < Duration::from_millis(60) {
                std::hint::spin_loop();
            }
            granted
        });
        if rival.join().expect("it does not panic") {
            assert!(witness.longest_stall() >= Duration::from_millis(40));
        }
    }
}
