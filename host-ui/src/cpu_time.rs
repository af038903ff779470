//! Processor time: the cost of a frame, independent of the machine's load.

/// Returns the processor time of this thread so far, ns; 0 if the system does not report it.
#[cfg(not(target_family = "wasm"))]
pub fn thread_ns() -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is valid for writes.
    let status = unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut time) };
    if status == 0 {
        time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
    } else {
        0
    }
}

/// Returns the time since the page's first call, ns: a browser reports no processor time.
#[cfg(target_family = "wasm")]
pub fn thread_ns() -> u64 {
    use std::sync::OnceLock;
    use web_time::Instant;
    static FIRST: OnceLock<Instant> = OnceLock::new();
    FIRST.get_or_init(Instant::now).elapsed().as_nanos() as u64
}
