//! Threads without real-time priority: those that answer hosts come before hosts and before long work.

use std::io;
use std::thread::{Builder, JoinHandle};

/// Nice value of the control thread and of the bridge: a stop must reach the loops while other hosts flood both.
const ANSWERING: i32 = -11;
/// Nice value of long work, and of hosts as they come.
const ORDINARY: i32 = 0;

/// Puts the calling thread before ordinary ones, if the user may do that. Threads and processes that it starts inherit
/// this.
pub fn answer_first() {
    let _ = rustix::process::setpriority_process(None, ANSWERING);
}

/// Starts long work on a thread of ordinary priority.
pub fn spawn<T: Send + 'static>(name: &str, work: impl FnOnce() -> T + Send + 'static) -> io::Result<JoinHandle<T>> {
    Builder::new().name(name.to_owned()).spawn(|| {
        let _ = rustix::process::setpriority_process(None, ORDINARY);
        work()
    })
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
