//! Detects lost time that the kernel does not account for: in a virtual machine its own count may stay 0.
//!
//! A thread spins for a part of each millisecond and reads the clock: on another core beside the loop, and on the
//! loop's own core before it starts. A gap without a thread switch is an interrupt, firmware, or a hypervisor that ran
//! something else.

use crate::sample::histogram;
use hdrhistogram::Histogram;
use stylet_runtime::rt::arm::{self, Ask, Usage};
use stylet_runtime::rt::clock;

pub const PERIOD_NS: u64 = 1_000_000;
/// Part of each period that is watched beside the loop.
pub const SPIN_NS: u64 = 100_000;
/// Phase away from the measured wake-ups: neither the force loop nor the tissue loop wakes during this spin, at 1 kHz.
const PHASE_NS: u64 = 800_000;
/// Two reads of the clock farther apart than this were interrupted.
const GAP_NS: u64 = 20_000;
/// Wake-ups later than this are kept: no tissue step takes so long.
const LATE_NS: u64 = 1_000_000;
/// Most gaps and late wake-ups kept individually.
const KEPT: usize = 4096;

/// Result of the gap watch.
pub struct GapReport {
    pub core: Option<usize>,
    /// Time that was watched.
    pub watched_ns: u64,
    /// Gaps longer than 20 us without a switch.
    pub gaps: Histogram<u64>,
    /// Gaps longer than 20 us in which another thread had the core.
    pub switched: Histogram<u64>,
    /// Lateness of the thread's wake-ups; nothing of normal priority can delay it.
    pub wake: Histogram<u64>,
    /// Begin and length of the first gaps of both kinds.
    pub found: Vec<(u64, u64)>,
    pub found_switched: Vec<(u64, u64)>,
    /// Due time and lateness of the first wake-ups that were very late.
    pub late: Vec<(u64, u64)>,
}

impl GapReport {
    /// Returns the longest gap that overlaps `[from_ns, to_ns]`.
    pub fn gap_during(&self, from_ns: u64, to_ns: u64) -> Option<u64> {
        longest_overlap(&self.found, from_ns, to_ns)
    }

    /// Returns the latest wake-up of the watch that overlaps `[from_ns, to_ns]`.
    pub fn late_during(&self, from_ns: u64, to_ns: u64) -> Option<u64> {
        longest_overlap(&self.late, from_ns, to_ns)
    }
}

fn longest_overlap(all: &[(u64, u64)], from_ns: u64, to_ns: u64) -> Option<u64> {
    let overlap = all
        .iter()
        .filter(|(begin, length)| *begin < to_ns && begin + length > from_ns);
    overlap.map(|(_, length)| *length).max()
}

/// How a core is watched.
#[derive(Clone, Copy)]
pub struct Look {
    pub core: Option<usize>,
    pub priority: Option<u32>,
    /// Part of each millisecond.
    pub spin_ns: u64,
}

/// Watches until `stop`.
pub fn watch(look: Look, stop: impl Fn() -> bool) -> GapReport {
    let Look { core, priority, .. } = look;
    let mut report = GapReport {
        core,
        watched_ns: 0,
        gaps: histogram(),
        switched: histogram(),
        wake: histogram(),
        found: Vec::with_capacity(KEPT),
        found_switched: Vec::with_capacity(KEPT),
        late: Vec::with_capacity(KEPT),
    };
    // Without the right to a priority it watches at normal priority: it distinguishes gaps from switches either way.
    let _armed = arm::arm(Ask { priority, core }).or_else(|_| arm::arm(Ask { priority: None, core }));
    let mut grid = clock::Grid::at_phase(clock::now_ns(), PERIOD_NS, PHASE_NS);
    while !stop() {
        clock::sleep_until(grid.due_ns);
        let late_ns = clock::now_ns().saturating_sub(grid.due_ns);
        report.wake.saturating_record(late_ns);
        if late_ns > LATE_NS && report.late.len() < KEPT {
            report.late.push((grid.due_ns, late_ns));
        }
        report.spin(look.spin_ns);
        grid.advance(clock::now_ns());
    }
    report
}

impl GapReport {
    fn spin(&mut self, spin_ns: u64) {
        let switches = |u: Usage| u.involuntary_switches + u.voluntary_switches;
        let mut before = switches(Usage::now());
        let begin_ns = clock::now_ns();
        let mut last_ns = begin_ns;
        while last_ns - begin_ns < spin_ns {
            let now_ns = clock::now_ns();
            let gap_ns = now_ns - last_ns;
            if gap_ns > GAP_NS {
                let after = switches(Usage::now());
                let (gaps, found) = if after == before {
                    (&mut self.gaps, &mut self.found)
                } else {
                    (&mut self.switched, &mut self.found_switched)
                };
                gaps.saturating_record(gap_ns);
                if found.len() < KEPT {
                    found.push((last_ns, gap_ns));
                }
                before = after;
            }
            last_ns = now_ns;
        }
        self.watched_ns += last_ns - begin_ns;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_overlaps_is_named_and_the_longest_wins() {
        let all = [(100, 50), (120, 10), (300, 5)];
        assert_eq!(longest_overlap(&all, 140, 200), Some(50));
        assert_eq!(longest_overlap(&all, 150, 300), None);
        assert_eq!(longest_overlap(&all, 0, 1000), Some(50));
    }
}
