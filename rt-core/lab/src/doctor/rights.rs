//! Rights: real-time priority and locked memory.

use super::Finding;
use crate::machine::Machine;
use stylet_runtime::rt::arm;

/// Numbers of capabilities, `linux/capability.h`.
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;
/// Priority of the force loop by default.
const WANTED_PRIORITY: u64 = 80;
/// Memory that the process locks, with a margin: code, stacks, one scene, shared memory of a few hosts.
const WANTED_LOCK_BYTES: u64 = 512 << 20;

pub fn priority(machine: &Machine) -> Finding {
    if machine.capable(CAP_SYS_NICE) {
        return Finding::good("priority", "this shell may use any real-time priority (CAP_SYS_NICE)");
    }
    match machine.limit("Max realtime priority") {
        Some(limit) if limit >= WANTED_PRIORITY => {
            Finding::good("priority", format!("real-time priorities up to {limit} are allowed"))
        }
        limit => {
            let limit = limit.unwrap_or(0);
            let what =
                format!("real-time priorities up to {limit} are allowed, the force loop asks for {WANTED_PRIORITY}");
            Finding::blocker("priority", what, arm::advice("grant it"))
        }
    }
}

pub fn memory_lock(machine: &Machine) -> Finding {
    if machine.capable(CAP_IPC_LOCK) {
        return Finding::good("memory lock", "this shell may lock all memory (CAP_IPC_LOCK)");
    }
    match machine.limit("Max locked memory") {
        Some(u64::MAX) => Finding::good("memory lock", "all memory may be locked"),
        Some(bytes) if bytes >= WANTED_LOCK_BYTES => {
            Finding::good("memory lock", format!("{} MiB may be locked", bytes >> 20))
        }
        bytes => {
            let what = format!(
                "only {} MiB may be locked; a page that is not locked can be taken away mid tick",
                bytes.unwrap_or(0) >> 20
            );
            Finding::blocker("memory lock", what, arm::advice("grant it"))
        }
    }
}
