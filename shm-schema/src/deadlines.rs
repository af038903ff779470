//! Missed deadlines of a loop and its worst wake-up, since a moment that a reset does not move.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Totals of one loop since it began, or since the force was last turned on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, Serialize, Deserialize)]
pub struct DeadlineTotals {
    /// Deadlines missed.
    pub missed: u64,
    /// Longest wake-up latency, ns.
    pub worst_wake_ns: u64,
}

impl DeadlineTotals {
    /// Adds a tick that woke `wake_latency_ns` after its deadline, with the deadlines missed just before it.
    pub fn add(&mut self, missed: u32, wake_latency_ns: u64) {
        self.missed += u64::from(missed);
        self.worst_wake_ns = self.worst_wake_ns.max(wake_latency_ns);
    }
}
