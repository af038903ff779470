//! Requests real-time properties from the kernel for a thread, and reads back what was granted.

use serde::{Deserialize, Serialize};
use std::io;
use std::marker::PhantomData;
use stylet_shm_schema::ThreadReport;

/// Real-time properties to request.
#[derive(Clone, Copy, Debug)]
pub struct Ask {
    /// `SCHED_FIFO` priority; `None` under `--no-rt`.
    pub priority: Option<u32>,
    /// Processor; `None` for any.
    pub core: Option<usize>,
}

/// Proof that this thread is armed; cannot leave it.
pub struct Armed {
    /// Granted properties, as read back.
    pub report: ThreadReport,
    not_send: PhantomData<*const ()>,
}

/// The missing right, and how to grant it.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// A priority that the kernel does not grant.
    #[error("{}", advice(&format!("the kernel does not grant SCHED_FIFO priority {priority} ({why})")))]
    Priority {
        /// The priority.
        priority: u32,
        /// Error of the kernel.
        why: io::Error,
    },
    /// A priority that the kernel granted, but does not report.
    #[error(
        "the kernel granted SCHED_FIFO priority {}, but reports policy {} and priority {}",
        .0.asked_priority, .0.policy, .0.priority
    )]
    NotConfirmed(ThreadReport),
    /// Memory that the kernel does not lock, with its error if there is one.
    #[error("{}", advice(&match .0 {
        Some(why) => format!("the kernel does not lock memory ({why})"),
        None => "the kernel does not lock memory".to_owned(),
    }))]
    MemoryLock(Option<io::Error>),
    /// The thread of the trial panicked.
    #[error("the trial of real-time scheduling ended by itself")]
    Trial,
}

/// Returns the commands that grant real-time rights.
pub fn advice(missing: &str) -> String {
    let program = std::env::current_exe().map_or_else(|_| "rt-core".into(), |p| p.display().to_string());
    format!(
        "{missing}. Either: sudo setcap cap_sys_nice,cap_ipc_lock=ep {program}   or put these three lines into \
         /etc/security/limits.d/stylet.conf and log in again: '@users - rtprio 90', '@users - nice -11' and \
         '@users - memlock unlimited'"
    )
}

/// Arms the calling thread: core, policy, stack. Fails only when a priority was requested and not granted.
pub fn arm(ask: Ask) -> Result<Armed, Refused> {
    if let Some(core) = ask.core {
        core_affinity::set_for_current(core_affinity::CoreId { id: core });
    }
    if let Some(priority) = ask.priority {
        let parameters = libc::sched_param {
            sched_priority: priority as libc::c_int,
        };
        // SAFETY: `parameters` is valid for reads; 0 names the calling thread.
        if unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) } != 0 {
            let why = io::Error::last_os_error();
            return Err(Refused::Priority { priority, why });
        }
    }
    let report = read_back(ask);
    confirm(&report)?;
    touch_stack();
    flush_denormals();
    Ok(Armed {
        report,
        not_send: PhantomData,
    })
}

/// Gives the calling thread a small share of a busy core. In the idle class it would get none, and name no cause of a
/// late tick. Does nothing if the kernel refuses.
pub fn lower_priority() {
    // SAFETY: no pointers; 0 names the calling thread.
    unsafe { libc::setpriority(libc::PRIO_PROCESS, 0, 10) };
}

/// Keeps all threads on one heap that returns no memory. Call it before other threads exist: a thread keeps a heap it
/// already has. Large blocks are separate ([`stylet_heap`]).
pub fn keep_one_heap() {
    // SAFETY: the options take any value.
    unsafe {
        libc::mallopt(libc::M_ARENA_MAX, 1);
        libc::mallopt(libc::M_TRIM_THRESHOLD, -1);
    }
}

/// Locks present and future pages; the error names the limit to raise.
pub fn lock_memory() -> Result<(), Refused> {
    // SAFETY: no preconditions.
    if unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) } == 0 {
        keep_one_heap();
        return Ok(());
    }
    Err(Refused::MemoryLock(Some(io::Error::last_os_error())))
}

/// A request to the kernel, in force until dropped.
pub struct CoresAwake {
    /// Longest exit from a sleep state that the kernel now allows, as read back, µs.
    pub exit_latency_us: i32,
    _request: std::fs::File,
}

/// Asks the kernel to keep the cores out of deep sleep states. `None` where the machine does not offer it or the right
/// is missing.
pub fn keep_cores_awake() -> Option<CoresAwake> {
    use std::os::unix::fs::FileExt;
    let request = std::fs::File::options()
        .read(true)
        .write(true)
        .open("/dev/cpu_dma_latency")
        .ok()?;
    // The kernel reads and writes microseconds as a C int.
    request.write_all_at(&0_i32.to_ne_bytes(), 0).ok()?;
    let mut in_force = [0; 4];
    request.read_exact_at(&mut in_force, 0).ok()?;
    Some(CoresAwake {
        exit_latency_us: i32::from_ne_bytes(in_force),
        _request: request,
    })
}

/// Checks that the kernel reports what was requested: [`stylet_shm_schema::flags::REAL_TIME`] relies on it.
fn confirm(report: &ThreadReport) -> Result<(), Refused> {
    let asked = report.asked_priority;
    if asked == 0 || (report.is_fifo() && report.priority == asked) {
        return Ok(());
    }
    Err(Refused::NotConfirmed(*report))
}

fn read_back(ask: Ask) -> ThreadReport {
    let mut parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: `parameters` is valid for writes; 0 names the calling thread.
    let policy = unsafe {
        libc::sched_getparam(0, &mut parameters);
        libc::sched_getscheduler(0)
    };
    ThreadReport {
        policy: u32::try_from(policy).unwrap_or(u32::MAX),
        priority: parameters.sched_priority.max(0) as u32,
        asked_priority: ask.priority.unwrap_or(0),
        asked_core: ask.core.map_or(u32::MAX, |c| c as u32),
        core: only_core().unwrap_or(u32::MAX),
        reserved: 0,
    }
}

/// Returns the core, if the kernel leaves this thread exactly one.
fn only_core() -> Option<u32> {
    // SAFETY: an all-zero set is valid.
    let mut set: libc::cpu_set_t = unsafe { std::mem::zeroed() };
    // SAFETY: `set` is valid for writes of its size.
    if unsafe { libc::sched_getaffinity(0, size_of::<libc::cpu_set_t>(), &mut set) } != 0 {
        return None;
    }
    // SAFETY: the index stays below the size of the set.
    let mut cores = (0..libc::CPU_SETSIZE as usize).filter(|&c| unsafe { libc::CPU_ISSET(c, &set) });
    match (cores.next(), cores.next()) {
        (Some(core), None) => Some(core as u32),
        _ => None,
    }
}

/// Writes 256 KiB of stack, more than any tick uses.
#[inline(never)]
fn touch_stack() {
    let mut stack = [0_u8; 256 * 1024];
    for page in stack.chunks_mut(4096) {
        page[0] = 1;
    }
    std::hint::black_box(&stack);
}

/// Turns denormal numbers off: each costs a hundred cycles, and the tail of the tissue is full of them.
fn flush_denormals() {
    #[cfg(target_arch = "x86_64")]
    {
        let mut control: u32 = 0;
        // SAFETY: reads and writes this thread's MXCSR; bits 15 and 6 are flush-to-zero and denormals-are-zero.
        unsafe {
            std::arch::asm!("stmxcsr [{}]", in(reg) &mut control);
            control |= (1 << 15) | (1 << 6);
            std::arch::asm!("ldmxcsr [{}]", in(reg) &control);
        }
    }
}

/// Cost of a thread since it was armed.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Usage {
    /// Allocations, frees and reallocations.
    pub heap_calls: u64,
    /// Page faults without a disk.
    pub minor_faults: i64,
    /// Page faults that read a disk.
    pub major_faults: i64,
    /// Context switches because the thread waited.
    pub voluntary_switches: i64,
    /// Context switches because another thread was preferred.
    pub involuntary_switches: i64,
}

impl Usage {
    /// Usage of the calling thread since it began.
    pub fn now() -> Self {
        // SAFETY: an all-zero rusage is valid.
        let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
        // SAFETY: `usage` is valid for writes.
        unsafe { libc::getrusage(libc::RUSAGE_THREAD, &mut usage) };
        Self {
            minor_faults: usage.ru_minflt,
            major_faults: usage.ru_majflt,
            voluntary_switches: usage.ru_nvcsw,
            involuntary_switches: usage.ru_nivcsw,
            heap_calls: stylet_heap::calls_of_this_thread(),
        }
    }

    /// Cost since `start`.
    pub fn since(self, start: Self) -> Self {
        Self {
            minor_faults: self.minor_faults - start.minor_faults,
            major_faults: self.major_faults - start.major_faults,
            voluntary_switches: self.voluntary_switches - start.voluntary_switches,
            involuntary_switches: self.involuntary_switches - start.involuntary_switches,
            heap_calls: self.heap_calls - start.heap_calls,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The state used to report the request as if the kernel had granted it.
    #[test]
    fn a_thread_that_the_kernel_does_not_confirm_is_not_armed() {
        let report = |policy, priority, asked_priority| ThreadReport {
            policy,
            priority,
            asked_priority,
            ..ThreadReport::default()
        };
        assert!(confirm(&report(0, 0, 0)).is_ok(), "nothing was asked for");
        assert!(confirm(&report(1, 80, 80)).is_ok());
        assert!(confirm(&report(0, 0, 80)).is_err());
        assert!(confirm(&report(1, 79, 80)).is_err());
    }
}
