//! Long work without the interpreter's lock, and errors of the simulator as Python's.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::fmt::Display;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Longest time until Ctrl+C is seen.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Returns a `ValueError` with that text.
pub fn refused(why: impl Display) -> PyErr {
    PyValueError::new_err(why.to_string())
}

/// Runs work on another thread, without the interpreter's lock; Ctrl+C sets its flag, and raises once the work has
/// ended.
pub fn interruptible<T: Send>(py: Python<'_>, work: impl FnOnce(&AtomicBool) -> T + Send) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    let waiting = std::thread::current();
    py.detach(|| {
        std::thread::scope(|scope| {
            let thread = scope.spawn(|| {
                let done = work(&stop);
                waiting.unpark();
                done
            });
            let mut interrupted = None;
            while !thread.is_finished() {
                std::thread::park_timeout(LOOK_EVERY);
                if interrupted.is_none() {
                    interrupted = Python::attach(|py| py.check_signals()).err();
                    // SYNC: nothing but the flag is carried.
                    stop.store(interrupted.is_some(), Ordering::Relaxed);
                }
            }
            let done = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            interrupted.map_or(Ok(done), Err)
        })
    })
}
