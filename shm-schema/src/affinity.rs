//! Keeps the threads of a host off the force loop's core, where drawing or sending would delay its wake-up.

use crate::Session;
use std::mem::size_of;

/// Largest age of an announcement made on this machine; the boot times of two machines differ by more.
const FRESH_NS: u64 = 2_000_000_000;

/// The core that a host has left to the force loop.
#[derive(Clone, Copy, Debug, Default)]
pub struct Left {
    core: Option<usize>,
}

impl Left {
    /// Leaves the core of the force loop that made this announcement, once. Does nothing if that loop has no core of
    /// its own or runs on another machine, as for a host behind a relay.
    pub fn leave(&mut self, session: &Session) {
        if let Some(core) = self.due(session, now_ns()) {
            keep_off(core);
        }
    }

    fn due(&mut self, session: &Session, now_ns: u64) -> Option<usize> {
        let is_here = now_ns.checked_sub(session.time_ns).is_some_and(|age| age < FRESH_NS);
        let core = session.haptic.own_core().filter(|_| is_here)?;
        (self.core.replace(core) != Some(core)).then_some(core)
    }
}

/// `CLOCK_MONOTONIC`, ns.
pub fn now_ns() -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is valid for writes; this clock always exists.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Takes the core from all threads of this program and those that they start later. Does nothing if it is their only
/// core, or if the system refuses.
pub fn keep_off(core: usize) {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else {
        return;
    };
    for task in tasks.flatten() {
        if let Some(thread) = task.file_name().to_str().and_then(|name| name.parse().ok()) {
            keep_thread_off(thread, core);
        }
    }
}

/// Lets this thread, and the program that it becomes, run on all cores again, also after [`keep_off`]. Allocates nothing,
/// so that it may run between fork and exec.
pub fn return_to_all_cores() {
    // SAFETY: all zeros is an empty set, which then holds every core; the kernel leaves out those that are not allowed.
    unsafe {
        let mut cores: libc::cpu_set_t = std::mem::zeroed();
        (0..libc::CPU_SETSIZE as usize).for_each(|core| libc::CPU_SET(core, &mut cores));
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &cores);
    }
}

fn keep_thread_off(thread: libc::pid_t, core: usize) {
    if core >= libc::CPU_SETSIZE as usize {
        return;
    }
    // SAFETY: all zeros is an empty set of cores.
    let mut cores: libc::cpu_set_t = unsafe { std::mem::zeroed() };
    // SAFETY: `cores` is valid for writes and for its size, and `core` is inside a set.
    unsafe {
        if libc::sched_getaffinity(thread, size_of::<libc::cpu_set_t>(), &mut cores) != 0 {
            return;
        }
        libc::CPU_CLR(core, &mut cores);
        if libc::CPU_COUNT(&cores) > 0 {
            libc::sched_setaffinity(thread, size_of::<libc::cpu_set_t>(), &cores);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allowed() -> Vec<usize> {
        // SAFETY: as above; 0 is this thread.
        unsafe {
            let mut cores: libc::cpu_set_t = std::mem::zeroed();
            assert_eq!(libc::sched_getaffinity(0, size_of::<libc::cpu_set_t>(), &mut cores), 0);
            (0..libc::CPU_SETSIZE as usize)
                .filter(|&core| libc::CPU_ISSET(core, &cores))
                .collect()
        }
    }

    #[test]
    fn a_core_is_left_once_and_only_to_a_local_real_time_loop() {
        let mut session: Session = bytemuck::Zeroable::zeroed();
        (session.time_ns, session.haptic.policy, session.haptic.core) = (10 * FRESH_NS, 1, 3);
        let now_ns = session.time_ns + FRESH_NS / 2;
        let mut left = Left::default();
        for other in [session.time_ns - 1, session.time_ns + FRESH_NS] {
            assert_eq!(left.due(&session, other), None, "the clock of another machine");
        }
        assert_eq!(left.due(&session, now_ns), Some(3));
        assert_eq!(left.due(&session, now_ns), None, "it was left");
        session.haptic.core = 2;
        assert_eq!(
            left.due(&session, now_ns),
            Some(2),
            "a core that was started again elsewhere"
        );
        session.haptic.core = u32::MAX;
        assert_eq!(left.due(&session, now_ns), None, "on several cores");
        (session.haptic.core, session.haptic.policy) = (1, 0);
        assert_eq!(left.due(&session, now_ns), None, "not in real time");
    }

    /// Runs in a separate thread, so that no other test loses a core.
    #[test]
    fn a_thread_and_its_children_leave_a_core_but_never_their_last() {
        let test = std::thread::spawn(|| {
            // SAFETY: it only names this thread.
            let me = unsafe { libc::gettid() };
            let before = allowed();
            for &core in &before {
                keep_thread_off(me, core);
            }
            let last = before.last().copied().into_iter().collect::<Vec<_>>();
            assert_eq!(allowed(), last);
            assert_eq!(std::thread::spawn(allowed).join().expect("no panic"), last);
            keep_thread_off(me, usize::MAX);
            return_to_all_cores();
            assert_eq!(allowed(), before);
        });
        test.join().expect("no panic");
    }
}
