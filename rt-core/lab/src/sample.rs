//! Samples of a run kept with its histograms, for a later examination of dependence, change and the far tail.

use hdrhistogram::Histogram;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Longest time that a histogram resolves; longer ones count as this.
const LONGEST_NS: u64 = 10_000_000_000;
/// Three digits: a value is known to 0.1 %.
const DIGITS: u8 = 3;
/// Equal parts of the run with a histogram each.
pub const PARTS: usize = 8;
/// Latest wake-ups kept with their grid point.
pub const LARGEST: usize = 2_000;
/// Wake-ups kept in time order; at least half this number, except in short runs.
const SERIES: usize = 16_384;

/// Returns a histogram of nanoseconds with fixed bounds.
pub fn histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1, LONGEST_NS, DIGITS).expect("the bounds are constants that fit")
}

/// Wake-ups of one loop. Everything is allocated before the run.
pub struct Sample {
    /// Histograms of equal parts of the run.
    pub parts: Vec<Histogram<u64>>,
    /// Wake-up latencies of every [`Sample::stride`]th tick, in nanoseconds.
    pub series: Vec<u64>,
    /// Ticks from one entry of the series to the next.
    pub stride: u64,
    /// Grid points of the run so far, missed ones included.
    pub grid: u64,
    part_grid: u64,
    ticks: u64,
    largest: BinaryHeap<Reverse<(u64, u64)>>,
}

impl Sample {
    /// Makes a sample of a run with `grid` planned grid points.
    pub fn new(grid: u64) -> Self {
        Self {
            parts: (0..PARTS).map(|_| histogram()).collect(),
            series: Vec::with_capacity(SERIES),
            stride: 1,
            grid: 0,
            part_grid: grid.div_ceil(PARTS as u64).max(1),
            ticks: 0,
            largest: BinaryHeap::with_capacity(LARGEST + 1),
        }
    }

    /// Takes a tick at the grid point `place` that woke `wake_ns` late.
    pub fn take(&mut self, place: u64, wake_ns: u64) {
        self.grid = place + 1;
        if let Some(part) = self.parts.get_mut((place / self.part_grid) as usize) {
            part.saturating_record(wake_ns);
        }
        if self.ticks.is_multiple_of(self.stride) {
            if self.series.len() == SERIES {
                self.thin();
            }
            // After thinning, this tick may lie between two entries.
            if self.ticks.is_multiple_of(self.stride) {
                self.series.push(wake_ns);
            }
        }
        self.ticks += 1;
        if self.largest.len() < LARGEST {
            self.largest.push(Reverse((wake_ns, place)));
        } else if self.largest.peek().is_some_and(|least| wake_ns > least.0.0) {
            self.largest.pop();
            self.largest.push(Reverse((wake_ns, place)));
        }
    }

    /// Keeps every second entry.
    fn thin(&mut self) {
        for i in 0..SERIES / 2 {
            self.series[i] = self.series[2 * i];
        }
        self.series.truncate(SERIES / 2);
        self.stride *= 2;
    }

    /// Returns the latest wake-ups as (grid point, nanoseconds), in the order of time.
    pub fn largest(&self) -> Vec<(u64, u64)> {
        let mut all: Vec<(u64, u64)> = self.largest.iter().map(|Reverse((ns, place))| (*place, *ns)).collect();
        all.sort_unstable();
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_random::Random;

    #[test]
    fn series_is_every_so_manieth_tick_and_the_largest_are_those_of_a_sort() {
        let mut random = Random(7);
        let all: Vec<u64> = (0..100_000).map(|_| random.draw() % 1_000_003).collect();
        let mut sample = Sample::new(100_000);
        for (i, &ns) in all.iter().enumerate() {
            sample.take(i as u64, ns);
        }
        assert_eq!(sample.stride, 8);
        let expected: Vec<u64> = all.iter().step_by(8).copied().collect();
        assert_eq!(sample.series, expected);
        let mut sorted: Vec<u64> = all.clone();
        sorted.sort_unstable_by(|a, b| b.cmp(a));
        let mut kept: Vec<u64> = sample.largest().iter().map(|(_, ns)| *ns).collect();
        assert!(sample.largest().iter().all(|(place, ns)| all[*place as usize] == *ns));
        kept.sort_unstable_by(|a, b| b.cmp(a));
        assert_eq!(kept, sorted[..LARGEST]);
    }

    #[test]
    fn parts_have_equal_shares_and_nothing_is_allocated_on_the_way() {
        let mut sample = Sample::new(80_000);
        let room = (sample.series.capacity(), sample.largest.capacity());
        for i in 0..80_000 {
            sample.take(i, i / 10_000 + 1);
        }
        for (i, part) in sample.parts.iter().enumerate() {
            assert_eq!(
                (part.len(), part.min(), part.max()),
                (10_000, i as u64 + 1, i as u64 + 1)
            );
        }
        assert_eq!((sample.series.capacity(), sample.largest.capacity()), room);
    }
}
