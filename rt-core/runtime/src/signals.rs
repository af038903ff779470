//! The end of a program: a flag that termination signals set, and the end of its parent.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Returns a flag that the first termination signal sets.
///
/// # Errors
/// If the kernel takes no handler.
pub fn stop_flag() -> io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}

/// Requests SIGTERM for this process when its parent dies, even by SIGKILL.
pub fn follow_parent() {
    // SAFETY: PR_SET_PDEATHSIG takes a signal number; getppid has no preconditions.
    let orphan = unsafe {
        libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM);
        libc::getppid() == 1
    };
    if orphan {
        std::process::exit(0);
    }
}
