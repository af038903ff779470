//! Detects stalls of the machine itself: on each core a thread above every loop sleeps two milliseconds at a time.
//!
//! A hypervisor that takes a core away for 100 ms rightly raises a fault, whatever the program does. Such a time is no
//! evidence for or against a test's claim, and is not judged.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Barrier};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Shortest stall that excuses a failure. Twenty missed deadlines in a row are a fault; the program must bear a stall
/// of fewer.
pub const STALL: Duration = Duration::from_millis(15);

const SLEEP: Duration = Duration::from_millis(2);
const PRIORITY: libc::c_int = 98;
/// Most attempts. A shared machine was seen to stall for 30 ms every five seconds, which is the length of an attempt.
const ATTEMPTS: usize = 12;
/// Latest start of an attempt.
const PATIENCE: Duration = Duration::from_secs(180);

#[derive(Default)]
struct Seen {
    is_over: AtomicBool,
    longest_ns: AtomicU64,
}

/// Watches every core until it is queried or dropped.
pub struct Witness {
    seen: Arc<Seen>,
    threads: Vec<JoinHandle<()>>,
}

impl Witness {
    /// Returns once every core is watched.
    pub fn begin() -> Self {
        let seen = Arc::new(Seen::default());
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
        let are_watching = Arc::new(Barrier::new(cores + 1));
        let thread = |core| {
            let (seen, are_watching) = (seen.clone(), are_watching.clone());
            std::thread::spawn(move || watch(core, &seen, &are_watching))
        };
        let threads = (0..cores).map(thread).collect();
        are_watching.wait();
        Self { seen, threads }
    }

    /// Returns the longest time in which a core ran nothing of the highest priority. Waits for the watcher of a core
    /// that is stalled now; otherwise a stall that has just ended would not count yet.
    pub fn longest_stall(mut self) -> Duration {
        self.stop();
        Duration::from_nanos(self.seen.longest_ns.load(Ordering::Relaxed))
    }

    fn stop(&mut self) {
        self.seen.is_over.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

impl Drop for Witness {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Watches a core. Without the rights for that priority it sees busy cores as well.
fn watch(core: usize, seen: &Seen, are_watching: &Barrier) {
    let priority = libc::sched_param {
        sched_priority: PRIORITY,
    };
    // SAFETY: plain data of this thread; a refusal changes nothing.
    unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        libc::CPU_SET(core, &mut set);
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &set);
        libc::sched_setscheduler(0, libc::SCHED_FIFO, &priority);
    }
    are_watching.wait();
    while !seen.is_over.load(Ordering::Relaxed) {
        let begun = Instant::now();
        std::thread::sleep(SLEEP);
        let late = begun.elapsed().saturating_sub(SLEEP);
        seen.longest_ns.fetch_max(late.as_nanos() as u64, Ordering::Relaxed);
    }
}

/// Runs a timing check, and repeats it for up to three minutes if it failed while the machine was stalled.
pub fn where_the_machine_runs(check: impl Fn()) {
    repeat_after_stalls(|| {
        let witness = Witness::begin();
        let outcome = catch_unwind(AssertUnwindSafe(&check));
        (outcome, witness.longest_stall())
    });
}

/// Repeats an attempt, which returns its outcome and the longest stall in it.
fn repeat_after_stalls(mut attempt: impl FnMut() -> (std::thread::Result<()>, Duration)) {
    let begun = Instant::now();
    for number in 1.. {
        let (outcome, stall) = attempt();
        let Err(panic) = outcome else { return };
        if stall < STALL || number == ATTEMPTS || begun.elapsed() > PATIENCE {
            println!("the longest stall of the machine was {stall:?}, in attempt {number}");
            resume_unwind(panic);
        }
        println!("a core stood still for {stall:?}: the check is repeated");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A failure on a running machine is a failure at once: it is not repeated until it passes.
    #[test]
    fn a_failure_is_repeated_only_where_a_core_stood_still() {
        let (ran, stood_still) = (STALL / 2, STALL * 2);
        for (stalls, passes_at, tries, passes) in [
            (vec![ran; 3], 2, 1, false),
            (vec![stood_still, ran, ran], 9, 2, false),
            (vec![stood_still; ATTEMPTS], 99, ATTEMPTS, false),
            (vec![stood_still, ran], 2, 2, true),
            (vec![stood_still], 1, 1, true),
        ] {
            let mut count = 0;
            let outcome = catch_unwind(AssertUnwindSafe(|| {
                repeat_after_stalls(|| {
                    count += 1;
                    let outcome: std::thread::Result<()> = if count == passes_at {
                        Ok(())
                    } else {
                        Err(Box::new("on purpose"))
                    };
                    (outcome, stalls[count - 1])
                })
            }));
            assert_eq!((count, outcome.is_ok()), (tries, passes), "{stalls:?}");
        }
    }

    /// From inside, a rival of higher priority on one core looks like a hypervisor.
    #[test]
    fn a_core_that_ran_nothing_is_seen() {
        let witness = Witness::begin();
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
