//! Keeps the threads of this program off the core of the force loop, which would wake up later on a core that draws.

use std::mem::size_of;

/// Takes the core from all threads of this program; those that they start from now on stay off it too. Nothing where it is
/// their only one, or where the system does not let us.
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

    /// In a thread of its own, so that no other test loses a core.
    #[test]
    fn a_thread_and_those_that_it_starts_stay_off_a_core_but_never_off_their_last() {
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
        });
        test.join().expect("no panic");
    }
}
