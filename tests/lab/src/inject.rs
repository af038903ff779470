//! Injections: each makes ticks of a running measurement late in one known way.

mod kernel;
mod threads;

use serde_json::Value;
use std::time::{Duration, Instant};

/// The measurement that is disturbed.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    pub process: i32,
    /// The thread of the force loop.
    pub thread: i32,
    pub core: usize,
}

/// Prefix of the names of all injection threads.
pub const NAME: &str = "inj-";

/// One way to make ticks late.
pub struct Injection {
    pub name: &'static str,
    /// Lateness in microseconds above which ticks are examined.
    pub over_us: u64,
    /// Injects until `end`; fails if this machine does not support it.
    pub run: fn(Target, Instant) -> Result<(), String>,
    /// Returns whether a cause in the report is the injected one.
    pub is_named: fn(&Value) -> bool,
}

fn kind(cause: &Value, kind: &str) -> bool {
    cause["kind"] == kind
}

fn who(cause: &Value, name: &str) -> bool {
    cause["who"].as_str().is_some_and(|w| w.contains(name))
}

/// All injections. The first three need only root.
pub const ALL: &[Injection] = &[
    Injection {
        name: "a thread of higher priority on the core",
        over_us: 250,
        run: threads::higher_priority,
        is_named: |c| kind(c, "higher-priority") && who(c, "inj-higher"),
    },
    Injection {
        name: "the process stopped by a signal",
        over_us: 250,
        run: threads::stopped,
        is_named: |c| kind(c, "stopped"),
    },
    Injection {
        name: "thousands of timers that expire at once",
        over_us: 250,
        run: threads::timers,
        is_named: |c| kind(c, "timers") && (who(c, "posix") || who(c, "timerfd")),
    },
    Injection {
        name: "a thread of the same priority on the core",
        over_us: 250,
        run: threads::same_priority,
        is_named: |c| kind(c, "same-priority") && who(c, "inj-same"),
    },
    Injection {
        name: "the loop's priority taken away",
        over_us: 250,
        run: threads::demoted,
        is_named: |c| kind(c, "lost-priority"),
    },
    Injection {
        name: "a softirq storm over the loopback",
        over_us: 250,
        run: kernel::softirqs,
        is_named: |c| kind(c, "soft-interrupt") && who(c, "NET_RX"),
    },
    Injection {
        name: "a control group's share of real-time work used up",
        over_us: 250,
        run: kernel::throttled,
        is_named: |c| kind(c, "throttled"),
    },
    Injection {
        name: "work of the kernel for a large write and fsync",
        over_us: 100,
        run: kernel::large_fsync,
        is_named: |c| {
            let inside = c["inside"].as_str().unwrap_or_default();
            kind(c, "kernel-work") && (who(c, "inj-fsync") || inside.contains("sync"))
        },
    },
    Injection {
        name: "the interrupt of the disk moved to the core",
        over_us: 60,
        run: kernel::disk_interrupt,
        is_named: |c| (kind(c, "interrupt") && who(c, "IRQ")) || (kind(c, "soft-interrupt") && who(c, "BLOCK")),
    },
    Injection {
        name: "memory bandwidth taken by others",
        over_us: 45,
        run: threads::memory,
        is_named: |c| kind(c, "slow-work"),
    },
];

/// Calls `each` until `end`, `every` apart.
fn until(end: Instant, every: Duration, mut each: impl FnMut()) {
    while Instant::now() < end {
        each();
        std::thread::sleep(every);
    }
}

/// Keeps the core busy for `time`.
fn spin(time: Duration) {
    let start = Instant::now();
    while start.elapsed() < time {
        std::hint::spin_loop();
    }
}

/// Runs `work` in a thread of this name, on `core` alone, at `priority` of `SCHED_FIFO`; 0 for a normal thread.
fn on_core<T: Send + 'static>(
    name: &'static str,
    core: usize,
    priority: i32,
    work: impl FnOnce() -> T + Send + 'static,
) -> std::thread::JoinHandle<Result<T, String>> {
    let begin = move || {
        // SAFETY: an all-zero set is valid and lives through the call; 0 names the calling thread.
        let pinned = unsafe {
            let mut set: libc::cpu_set_t = std::mem::zeroed();
            libc::CPU_SET(core, &mut set);
            libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &set)
        };
        if pinned != 0 || (priority > 0 && schedule(0, libc::SCHED_FIFO, priority).is_err()) {
            return Err(format!("{name}: {}", std::io::Error::last_os_error()));
        }
        Ok(work())
    };
    std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(begin)
        .expect("a thread starts")
}

fn schedule(thread: i32, policy: i32, priority: i32) -> Result<(), String> {
    let parameters = libc::sched_param {
        sched_priority: priority,
    };
    // SAFETY: `parameters` is valid for reads.
    match unsafe { libc::sched_setscheduler(thread, policy, &parameters) } {
        0 => Ok(()),
        _ => Err(std::io::Error::last_os_error().to_string()),
    }
}

/// Returns the result of a thread of [`on_core`].
fn ended<T>(thread: std::thread::JoinHandle<Result<T, String>>) -> Result<T, String> {
    thread.join().map_err(|_| "the injection panicked".to_owned())?
}
