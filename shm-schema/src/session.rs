//! Description of a run of `rt-core`, with its grants from the kernel.

use crate::{ExercisesInForce, Text};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Announced five times a second, and to every new host. A recording keeps the fields that describe the run.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, Serialize, Deserialize)]
#[serde(default)]
pub struct Session {
    /// Number of the run; unique.
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
    /// 1 if `--no-rt` was requested.
    #[serde(skip)]
    pub no_rt_asked: u32,
    /// Host messages refused in this run.
    #[serde(skip)]
    pub refused: u64,
    /// Instructor-injected faults.
    #[serde(skip)]
    pub exercises: ExercisesInForce,
    /// Name of the device.
    pub device: Text<64>,
    /// Name of the second device; empty without one.
    pub second_device: Text<64>,
    /// Version of the core.
    pub version: Text<32>,
    /// Requests that were not granted, and their remedies; empty if everything was granted.
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

/// One thread's request, and the kernel's report of it.
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
    /// Requested core; `u32::MAX` for none.
    pub asked_core: u32,
    /// The one core allowed by `sched_getaffinity`, or `u32::MAX` if there are several.
    pub core: u32,
    /// Zero.
    pub reserved: u32,
}

impl ThreadReport {
    /// True if the kernel reports `SCHED_FIFO`.
    pub fn is_fifo(&self) -> bool {
        self.policy == 1
    }

    /// Core of a thread with real-time priority, which hosts on its machine leave to it.
    pub fn own_core(&self) -> Option<usize> {
        (self.is_fifo() && self.core != u32::MAX).then_some(self.core as usize)
    }
}
