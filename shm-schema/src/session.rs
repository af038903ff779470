//! Which run of `rt-core` this is and what it got from the kernel.

use crate::{ExercisesInForce, Text};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Announced five times a second, and to every new host. A recording keeps what describes the run.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, Serialize, Deserialize)]
#[serde(default)]
pub struct Session {
    /// Number of the run; differs from every other run.
    pub session_id: u64,
    /// [`crate::SCHEMA_VERSION`] of the core.
    pub schema_version: u32,
    /// Process of the core.
    #[serde(skip)]
    pub pid: u32,
    /// `CLOCK_MONOTONIC` of this announcement: the heartbeat of the bridge.
    #[serde(skip)]
    pub time_ns: u64,
    /// `CLOCK_MONOTONIC` at the start of the run.
    #[serde(skip)]
    pub started_ns: u64,
    /// Period of the force loop.
    pub period_ns: u64,
    /// Period of the tissue loop.
    pub tissue_period_ns: u64,
    /// Period of the second device's loop; 0 in a run without one.
    pub second_period_ns: u64,
    /// Thread of the force loop.
    pub haptic: ThreadReport,
    /// Thread of the tissue loop.
    pub tissue: ThreadReport,
    /// Thread of the second device's loop.
    pub second: ThreadReport,
    /// 1 when `mlockall` succeeded.
    pub memory_locked: u32,
    /// 1 when `--no-rt` was asked for.
    #[serde(skip)]
    pub no_rt_asked: u32,
    /// Messages from hosts that were refused in this run.
    #[serde(skip)]
    pub refused: u64,
    /// Faults that an instructor put in.
    #[serde(skip)]
    pub exercises: ExercisesInForce,
    /// Name of the device.
    pub device: Text<64>,
    /// Name of the second device; empty without one.
    pub second_device: Text<64>,
    /// Version of the core.
    pub version: Text<32>,
    /// What was asked for and not granted, and what to do about it; empty when nothing is missing.
    #[serde(skip)]
    pub advice: Text<512>,
}

impl Default for Session {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl Session {
    /// The run has a second device.
    pub fn has_second(&self) -> bool {
        self.second_period_ns > 0
    }
}

/// What one thread asked for and what the kernel says it has.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
#[serde(default)]
pub struct ThreadReport {
    /// As `sched_getscheduler` reports it: 0 `SCHED_OTHER`, 1 `SCHED_FIFO`.
    pub policy: u32,
    /// Priority in force; 0 outside `SCHED_FIFO`.
    pub priority: u32,
    /// Priority that was requested; 0 for none.
    pub asked_priority: u32,
    /// Core asked for; `u32::MAX` for none.
    pub asked_core: u32,
    /// The one core that `sched_getaffinity` leaves it, or `u32::MAX` when it may run on several.
    pub core: u32,
    /// Zero.
    pub reserved: u32,
}

impl ThreadReport {
    /// Whether the kernel reports `SCHED_FIFO`.
    pub fn is_fifo(&self) -> bool {
        self.policy == 1
    }

    /// The core that a thread of real-time priority has, and that hosts on its machine leave to it.
    pub fn own_core(&self) -> Option<usize> {
        (self.is_fifo() && self.core != u32::MAX).then_some(self.core as usize)
    }
}
