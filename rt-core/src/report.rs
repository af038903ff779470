//! Cost of the loops of a run, as written by `rt-core --report`.

use serde::Serialize;
use stylet_runtime::process::{LoopReport, RunReport};
use stylet_runtime::rt::arm::Usage;

/// Every loop.
#[derive(Serialize)]
pub struct Report {
    haptic: Loop,
    tissue: Loop,
    /// Present in a run with a second device.
    #[serde(skip_serializing_if = "Option::is_none")]
    second: Option<Loop>,
}

#[derive(Serialize)]
struct Loop {
    /// Scheduling policy by the kernel's number.
    policy: u32,
    priority: u32,
    /// `u32::MAX` for any core.
    core: u32,
    ticks: u64,
    /// Since the start, regardless of resets.
    missed_deadlines: u64,
    /// Since the start, to a tenth.
    worst_wake_us: f64,
    /// Since the force was last turned on.
    missed_deadlines_since_armed: u64,
    /// Since then, to a tenth.
    worst_wake_since_armed_us: f64,
    #[serde(flatten)]
    usage: Usage,
}

fn tenths_us(ns: u64) -> f64 {
    (ns as f64 / 1e2).round() / 1e1
}

impl From<&RunReport> for Report {
    fn from(run: &RunReport) -> Self {
        Self {
            haptic: (&run.haptic).into(),
            tissue: (&run.tissue).into(),
            second: run.second.as_ref().map(Loop::from),
        }
    }
}

impl From<&LoopReport> for Loop {
    fn from(r: &LoopReport) -> Self {
        Self {
            policy: r.thread.policy,
            priority: r.thread.priority,
            core: r.thread.core,
            ticks: r.ticks,
            missed_deadlines: r.since_start.missed,
            worst_wake_us: tenths_us(r.since_start.worst_wake_ns),
            missed_deadlines_since_armed: r.since_armed.missed,
            worst_wake_since_armed_us: tenths_us(r.since_armed.worst_wake_ns),
            usage: r.usage,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scripts read these names.
    #[test]
    fn the_names_of_the_fields_are_kept() {
        let mut run = RunReport::default();
        run.haptic.since_start.worst_wake_ns = 12_340;
        run.haptic.since_armed.missed = 3;
        let json = serde_json::to_value(Report::from(&run)).expect("numbers");
        assert_eq!(json["haptic"]["worst_wake_us"], 12.3);
        assert_eq!(json["haptic"]["missed_deadlines_since_armed"], 3);
        let names: Vec<_> = json["tissue"].as_object().expect("an object").keys().cloned().collect();
        let mut expected = [
            "policy",
            "priority",
            "core",
            "ticks",
            "missed_deadlines",
            "worst_wake_us",
            "missed_deadlines_since_armed",
            "worst_wake_since_armed_us",
            "heap_calls",
            "minor_faults",
            "major_faults",
            "voluntary_switches",
            "involuntary_switches",
        ];
        expected.sort_unstable();
        let mut names = names;
        names.sort_unstable();
        assert_eq!(names, expected);
    }
}
