//! Threads without real-time priority: those that answer hosts come before hosts and before long work.
//!
//! A core that is stepped has no threads: its long work is done at once.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};

/// Nice value of the control thread and of the bridge: a stop must reach the loops while other hosts flood both.
#[cfg(not(target_family = "wasm"))]
const ANSWERING: i32 = -11;
/// Nice value of long work, and of hosts as they come.
#[cfg(not(target_family = "wasm"))]
const ORDINARY: i32 = 0;

/// Puts the calling thread before ordinary ones, if the user may do that. Threads and processes that it starts inherit
/// this.
#[cfg(not(target_family = "wasm"))]
pub fn answer_first() {
    let _ = rustix::process::setpriority_process(None, ANSWERING);
}

/// Starts long work on a thread of ordinary priority.
pub fn spawn<T: Send + 'static>(name: &str, work: impl FnOnce() -> T + Send + 'static) -> io::Result<JoinHandle<T>> {
    Builder::new().name(name.to_owned()).spawn(|| {
        #[cfg(not(target_family = "wasm"))]
        let _ = rustix::process::setpriority_process(None, ORDINARY);
        work()
    })
}

/// Where long work is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// On threads of ordinary priority.
    Threads,
    /// By the caller, before it goes on.
    AtOnce,
}

/// Long work that ends early when it is dropped or told to stop.
pub struct Task<T> {
    work: Running<T>,
    stop: StopOnDrop,
}

enum Running<T> {
    Thread(JoinHandle<T>),
    Done(T),
}

struct StopOnDrop(Arc<AtomicBool>);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        // SYNC: read by the thread; nothing but the flag is carried.
        self.0.store(true, Ordering::Relaxed);
    }
}

impl<T: Send + 'static> Task<T> {
    /// Starts work that polls whether to stop.
    pub fn spawn(name: &str, place: Work, work: impl FnOnce(&AtomicBool) -> T + Send + 'static) -> io::Result<Self> {
        let stop = Arc::<AtomicBool>::default();
        let stopped = Arc::clone(&stop);
        Ok(Self {
            work: match place {
                Work::Threads => Running::Thread(spawn(name, move || work(&stopped))?),
                Work::AtOnce => Running::Done(work(&stopped)),
            },
            stop: StopOnDrop(stop),
        })
    }

    /// Tells the work to stop.
    pub fn stop(&self) {
        // SYNC: as in `drop`.
        self.stop.0.store(true, Ordering::Relaxed);
    }

    /// True once the work has ended.
    pub fn is_finished(&self) -> bool {
        match &self.work {
            Running::Thread(thread) => thread.is_finished(),
            Running::Done(_) => true,
        }
    }

    /// Returns the result; `None` if the work panicked.
    pub fn result(self) -> Option<T> {
        match self.work {
            Running::Thread(thread) => thread.join().ok(),
            Running::Done(result) => Some(result),
        }
    }
}

/// True while work that polls this flag goes on.
pub fn goes_on(stop: &AtomicBool) -> bool {
    // SYNC: nothing but the flag is carried.
    !stop.load(Ordering::Relaxed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_work_of_a_thread_that_answers_first_is_ordinary() {
        let nice = || rustix::process::getpriority_process(None).expect("of this thread");
        let seen = std::thread::spawn(move || {
            answer_first();
            let own = nice();
            (own, spawn("work", nice).expect("a thread").join().expect("it ends"))
        });
        let (own, of_work) = seen.join().expect("it ends");
        // Without the right both stay where the test began.
        let wanted = if own == ANSWERING { ORDINARY } else { own };
        assert_eq!(of_work, wanted, "next to {own}");
    }
}
