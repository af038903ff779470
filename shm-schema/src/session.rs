//! Which run of `rt-core` this is and what it got from the kernel.

use crate::Text;
use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Announced once a second and to every host that comes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.Session")]
pub struct Session {
    pub session_id: u64,
    pub schema_version: u32,
    pub pid: u32,
    /// `CLOCK_MONOTONIC` of this announcement: the heartbeat of the bridge.
    pub time_ns: u64,
    pub started_ns: u64,
    pub period_ns: u64,
    pub tissue_period_ns: u64,
    pub haptic: ThreadReport,
    pub tissue: ThreadReport,
    /// 1 when `mlockall` succeeded.
    pub memory_locked: u32,
    /// 1 when `--no-rt` was asked for.
    pub no_rt_asked: u32,
    /// Messages from hosts that were refused in this run.
    pub refused: u64,
    pub device: Text<64>,
    pub version: Text<32>,
    /// What was asked for and not granted, and what to do about it; empty when nothing is missing.
    pub advice: Text<512>,
}

/// What one thread asked for and what the kernel says it has.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("stylet.ThreadReport")]
pub struct ThreadReport {
    /// As `sched_getscheduler` tells: 0 `SCHED_OTHER`, 1 `SCHED_FIFO`.
    pub policy: u32,
    pub priority: u32,
    pub asked_priority: u32,
    /// Core asked for; `u32::MAX` for none.
    pub asked_core: u32,
    /// The one core that `sched_getaffinity` leaves it, or `u32::MAX` when it may run on several.
    pub core: u32,
    pub reserved: u32,
}

impl ThreadReport {
    pub fn is_fifo(&self) -> bool {
        self.policy == 1
    }
}
