//! Short scheduler slices and precise timers for threads that mostly wait: next to computing programs they run sooner.

/// Argument of `sched_setattr` (its first version).
#[repr(C)]
struct Attributes {
    size: u32,
    policy: u32,
    flags: u64,
    nice: i32,
    priority: u32,
    runtime: u64,
    deadline: u64,
    period: u64,
}

/// Shortest slice that the kernel accepts.
const SLICE_NS: u64 = 100_000;

/// Shortens the slices of this thread and those that it starts. The priority is unchanged: the same share comes in
/// smaller parts. Has no effect on kernels before 6.12 or that refuse.
pub fn shorten() {
    // SAFETY: numbers alone.
    let nice = unsafe { libc::getpriority(libc::PRIO_PROCESS, 0) };
    let attributes = Attributes {
        size: size_of::<Attributes>() as u32,
        policy: libc::SCHED_OTHER as u32,
        flags: 0,
        nice,
        priority: 0,
        runtime: SLICE_NS,
        deadline: 0,
        period: 0,
    };
    // SAFETY: `attributes` is valid for reads and for its size; 0 is this thread. The slack, which lets the kernel wake
    // several threads at once, 50 us late, is a figure of this thread as well.
    unsafe {
        libc::syscall(libc::SYS_sched_setattr, 0, &attributes, 0);
        libc::prctl(libc::PR_SET_TIMERSLACK, 1_usize);
    }
}

/// Lets threads that wake to pass data on run before this one, whose work takes milliseconds and may be late by as
/// many.
pub fn let_others_first() {
    const NICE: i32 = 5;
    // SAFETY: numbers alone; 0 is this thread. A refusal changes nothing.
    unsafe { libc::setpriority(libc::PRIO_PROCESS, 0, NICE) };
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns this thread's slice as the kernel reports it; `None` if it knows no slices.
    fn slice_ns() -> Option<u64> {
        // SAFETY: numbers alone.
        let mut attributes: Attributes = unsafe { std::mem::zeroed() };
        let size = size_of::<Attributes>();
        // SAFETY: `attributes` is valid for writes and for its size; 0 is this thread.
        let taken = unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &mut attributes, size, 0) };
        (taken == 0 && attributes.runtime > 0).then_some(attributes.runtime)
    }

    /// Runs in a separate thread, so that no other test has short slices.
    #[test]
    fn slices_are_short_for_a_thread_and_those_that_it_starts() {
        let test = std::thread::spawn(|| {
            if slice_ns().is_none() {
                eprintln!("skipped: this kernel has no slices of a thread's own");
                return;
            }
            shorten();
            assert_eq!(slice_ns(), Some(SLICE_NS));
            let started = std::thread::spawn(slice_ns).join().expect("no panic");
            assert_eq!(started, Some(SLICE_NS));
        });
        test.join().expect("no panic");
    }
}
