//! Samples of a run: histograms of the whole and of its equal parts, and wake-ups in the order of time.

use hdrhistogram::Histogram;
use std::ops::Deref;

/// Time at the start that is not recorded: caches and page tables are still filling.
pub const WARM_UP_S: f64 = 0.5;
/// Longest time that a histogram resolves; longer ones count as this.
const LONGEST_NS: u64 = 10_000_000_000;
/// Three digits: a value is known to 0.1 %.
const DIGITS: u8 = 3;
/// Equal parts of the run with a histogram each.
pub const PARTS: usize = 8;
/// Wake-ups kept in time order; at least half this number, except in short runs.
const SERIES: usize = 16_384;

/// Returns a histogram of nanoseconds with fixed bounds.
pub fn histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1, LONGEST_NS, DIGITS).expect("the bounds are constants that fit")
}

/// A wake-up is late once it has used this fraction of its period.
pub const LATE_SHARE: u64 = 5;

/// Returns the lateness from which a wake-up is late, where a bin of the histogram begins.
pub fn late_from_ns(period_ns: u64) -> u64 {
    histogram().lowest_equivalent(period_ns / LATE_SHARE)
}

/// Values of a run, together and in its equal parts, whose differences show how far values depend on each other.
#[derive(Clone)]
pub struct Batched {
    pub whole: Histogram<u64>,
    pub parts: Vec<Histogram<u64>>,
}

impl Default for Batched {
    fn default() -> Self {
        Self {
            whole: histogram(),
            parts: (0..PARTS).map(|_| histogram()).collect(),
        }
    }
}

impl Deref for Batched {
    type Target = Histogram<u64>;

    fn deref(&self) -> &Self::Target {
        &self.whole
    }
}

impl Batched {
    /// Takes a value of that part of the run; the last part takes all beyond the plan.
    pub fn take(&mut self, part: usize, ns: u64) {
        self.whole.saturating_record(ns);
        self.parts[part.min(PARTS - 1)].saturating_record(ns);
    }
}

/// Wake-ups of one loop in the order of time. Everything is allocated before the run.
#[derive(Clone)]
pub struct Sample {
    /// Wake-up latencies of every [`Sample::stride`]th tick, in nanoseconds.
    pub series: Vec<u64>,
    /// Ticks from one entry of the series to the next.
    pub stride: u64,
    ticks: u64,
}

impl Default for Sample {
    fn default() -> Self {
        Self {
            series: Vec::with_capacity(SERIES),
            stride: 1,
            ticks: 0,
        }
    }
}

impl Sample {
    /// Takes a tick that woke `wake_ns` late.
    pub fn take(&mut self, wake_ns: u64) {
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
    }

    /// Keeps every second entry.
    fn thin(&mut self) {
        for i in 0..SERIES / 2 {
            self.series[i] = self.series[2 * i];
        }
        self.series.truncate(SERIES / 2);
        self.stride *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_random::Random;

    #[test]
    fn series_is_every_so_manieth_tick() {
        let mut random = Random(7);
        let all: Vec<u64> = (0..100_000).map(|_| random.draw() % 1_000_003).collect();
        let mut sample = Sample::default();
        all.iter().for_each(|&ns| sample.take(ns));
        assert_eq!(sample.stride, 8);
        let expected: Vec<u64> = all.iter().step_by(8).copied().collect();
        assert_eq!(sample.series, expected);
    }

    #[test]
    fn parts_and_whole_hold_each_value_once() {
        let mut all = Batched::default();
        for i in 0..90_000 {
            all.take(i / 10_000, i as u64 / 10_000 + 1);
        }
        let counts: Vec<u64> = all.parts.iter().map(Histogram::len).collect();
        // What lies beyond the plan belongs to the last part.
        assert_eq!(counts, [10_000, 10_000, 10_000, 10_000, 10_000, 10_000, 10_000, 20_000]);
        let mut joined = histogram();
        all.parts
            .iter()
            .for_each(|part| joined.add(part).expect("the same bins"));
        assert_eq!(joined, all.whole);
    }

    #[test]
    fn the_series_is_never_allocated_anew() {
        let mut sample = Sample::default();
        let room = sample.series.capacity();
        (0..80_000).for_each(|i| sample.take(i));
        assert_eq!(sample.series.capacity(), room);
    }
}
