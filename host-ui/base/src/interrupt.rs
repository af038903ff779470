//! Ctrl-C, or a request to terminate: the first asks for an end in good order, the second ends at once. And an end of output.

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Long work asks now and then whether it is to end.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    pub fn on_signals() -> Result<Self, String> {
        let interrupt = Self::default();
        for signal in [SIGINT, SIGTERM] {
            flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&interrupt.0))
                .and_then(|_| flag::register(signal, Arc::clone(&interrupt.0)))
                .map_err(|e| format!("Ctrl-C cannot be caught ({e})"))?;
        }
        Ok(interrupt)
    }

    /// Asks as a signal would.
    pub fn ask(&self) {
        // SYNC: read by `asked`; nothing but the flag is carried.
        self.0.store(true, Ordering::Relaxed);
    }

    pub fn asked(&self) -> bool {
        // SYNC: set by a signal handler or by `ask`; nothing but the flag is carried.
        self.0.load(Ordering::Relaxed)
    }
}

/// A command whose output nobody reads any more ends without a word, as `head` expects of it; Rust would have it panic.
pub fn end_with_reader() {
    // SAFETY: the default action of a signal is no code of ours, and no thread has been started that could mind.
    unsafe { libc::signal(libc::SIGPIPE, libc::SIG_DFL) };
}
