//! Ctrl-C, termination requests and a closing terminal: the first asks for an orderly end, the
//! second ends at once.

#[cfg(unix)]
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
#[cfg(unix)]
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Request to end, which long work checks now and then.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

/// Error of a Ctrl-C handler that cannot be installed.
#[derive(Debug, thiserror::Error)]
#[error("Ctrl-C cannot be caught ({0})")]
pub struct InterruptError(std::io::Error);

impl Interrupt {
    /// Creates an interrupt that SIGINT, SIGTERM and, except under `nohup`, SIGHUP set; a second
    /// signal ends the program at once.
    ///
    /// # Errors
    ///
    /// If the handlers cannot be installed.
    #[cfg(unix)]
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

    /// Requests an end, like a signal.
    pub fn ask(&self) {
        // SYNC: read by `asked`; only the flag is carried.
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns whether the work must end.
    pub fn asked(&self) -> bool {
        // SYNC: set by a signal handler or by `ask`; only the flag is carried.
        self.0.load(Ordering::Relaxed)
    }
}

#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    // SAFETY: all zero is a valid value, and the call only writes to it.
    unsafe {
        let mut now: libc::sigaction = std::mem::zeroed();
        libc::sigaction(signal, std::ptr::null(), &raw mut now) == 0 && now.sa_sigaction == libc::SIG_IGN
    }
}
