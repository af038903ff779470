//! Ctrl-C, requests to terminate and a terminal that closes: the first asks for an orderly end, the second ends at once. And the end of output.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A request to end, which long work checks now and then.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

/// Ctrl-C cannot be caught.
#[derive(Debug, thiserror::Error)]
#[error("Ctrl-C cannot be caught ({0})")]
pub struct InterruptError(std::io::Error);

impl Interrupt {
    /// An interrupt that SIGINT, SIGTERM and, but under `nohup`, SIGHUP set; a second signal ends the program at once.
    ///
    /// # Errors
    /// Where the handlers cannot be installed.
    pub fn on_signals() -> Result<Self, InterruptError> {
        let interrupt = Self::default();
        let of_terminal = (!is_ignored(SIGHUP)).then_some(SIGHUP);
        for signal in [SIGINT, SIGTERM].into_iter().chain(of_terminal) {
            flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&interrupt.0))
                .and_then(|_| flag::register(signal, Arc::clone(&interrupt.0)))
                .map_err(InterruptError)?;
        }
        Ok(interrupt)
    }

    /// Requests an end, as a signal would.
    pub fn ask(&self) {
        // SYNC: read by `asked`; nothing but the flag is carried.
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the work is to end.
    pub fn asked(&self) -> bool {
        // SYNC: set by a signal handler or by `ask`; nothing but the flag is carried.
        self.0.load(Ordering::Relaxed)
    }
}

fn is_ignored(signal: i32) -> bool {
    // SAFETY: all zero is a valid value, and the call only writes to it.
    unsafe {
        let mut now: libc::sigaction = std::mem::zeroed();
        libc::sigaction(signal, std::ptr::null(), &raw mut now) == 0 && now.sa_sigaction == libc::SIG_IGN
    }
}

/// Lets a command whose output nobody reads any more end silently, as `head` expects; by default Rust panics.
pub fn end_with_reader() {
    // SAFETY: the default action of a signal is no code of ours, and no thread has been started that could mind.
    unsafe { libc::signal(libc::SIGPIPE, libc::SIG_DFL) };
}
