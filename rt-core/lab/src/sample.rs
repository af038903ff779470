//! Samples of a run kept with its histograms, for a later examination of dependence and change.

use hdrhistogram::Histogram;

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

/// Wake-ups of one loop. Everything is allocated before the run.
pub struct Sample {
    /// Histograms of equal parts of the run.
    pub parts: Vec<Histogram<u64>>,
    /// Wake-up latencies of every [`Sample::stride`]th tick, in nanoseconds.
    pub series: Vec<u64>,
    /// Ticks from one entry of the series to the next.
    pub stride: u64,
    part_grid: u64,
    ticks: u64,
}

impl Sample {
    /// Makes a sample of a run with `grid` planned grid points.
    pub fn new(grid: u64) -> Self {
        Self {
            parts: (0..PARTS).map(|_| histogram()).collect(),
            series: Vec::with_capacity(SERIES),
            stride: 1,
            part_grid: grid.div_ceil(PARTS as u64).max(1),
            ticks: 0,
        }
    }

    /// Takes a tick at the grid point `place` that woke `wake_ns` late.
    pub fn take(&mut self, place: u64, wake_ns: u64) {
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
        let mut sample = Sample::new(100_000);
        for (i, &ns) in all.iter().enumerate() {
            sample.take(i as u64, ns);
        }
        assert_eq!(sample.stride, 8);
        let expected: Vec<u64> = all.iter().step_by(8).copied().collect();
        assert_eq!(sample.series, expected);
    }

    #[test]
    fn parts_have_equal_shares_and_nothing_is_allocated_on_the_way() {
        let mut sample = Sample::new(80_000);
        let room = sample.series.capacity();
        for i in 0..80_000 {
            sample.take(i, i / 10_000 + 1);
        }
        for (i, part) in sample.parts.iter().enumerate() {
            assert_eq!(
                (part.len(), part.min(), part.max()),
                (10_000, i as u64 + 1, i as u64 + 1)
            );
        }
        assert_eq!(sample.series.capacity(), room);
    }
}
