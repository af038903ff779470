//! The cause of each late tick, from the kernel's own trace.
//!
//! A trace instance runs in a bounded buffer ([`tracefs`]). After a late tick a thread of normal priority freezes it,
//! reads it ([`witness`]), parses its lines as events ([`event`]), reconstructs the use of the core ([`timeline`]), and
//! names the causes between the tick's deadline and its wake-up ([`blame`], [`words`]).

mod blame;
pub(crate) mod counters;
mod event;
#[cfg(test)]
mod tests;
mod timeline;
mod tracefs;
mod witness;
mod words;

pub use blame::{Cause, Kind};
pub use tracefs::{Instance, TraceError, keep};
pub use witness::{Watched, watch};

use serde::{Deserialize, Serialize};

/// Late ticks kept with their trace; a later one replaces the least late.
pub const KEPT: usize = 32;

/// Holder of the core over an interval, microseconds from the tick's deadline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TracePiece {
    pub from_us: f64,
    pub us: f64,
    pub who: String,
}

/// Count of something around a late tick.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Counted {
    pub what: String,
    pub times: u64,
}

/// A late tick with its causes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Outlier {
    #[serde(skip)]
    pub due_ns: u64,
    /// Seconds into the measurement.
    pub at_s: f64,
    pub wake_us: f64,
    pub work_us: f64,
    /// All causes in words.
    pub cause: String,
    pub causes: Vec<Cause>,
    /// Counts on this core in the `counted_over_ms` around it, the most frequent first.
    pub counted: Vec<Counted>,
    pub counted_over_ms: f64,
    /// System management interrupts in the same time; absent if they cannot be counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub system_management_interrupts: Option<u64>,
    /// The trace around it.
    pub trace: Vec<TracePiece>,
}

/// Result of the trace of a run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct TraceSection {
    /// Reason why there is no trace.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub absent: Option<String>,
    /// Lateness from which a tick counts: wake-up, or wake-up and own work together.
    pub over_us: f64,
    pub buffer_kib_per_core: u64,
    pub events: Vec<String>,
    pub late_ticks: u64,
    /// Late ticks without a trace, because the buffer was being read or did not reach back far enough.
    pub untraced: u64,
    pub longest_read_ms: f64,
    pub lost_events: u64,
    /// The latest ones, in the order of time.
    pub outliers: Vec<Outlier>,
}

impl TraceSection {
    /// Returns the section of a run whose trace failed.
    pub fn absent(over_ns: u64, why: &TraceError) -> Self {
        Self {
            absent: Some(why.to_string()),
            over_us: over_ns as f64 / 1e3,
            ..Self::default()
        }
    }
}
