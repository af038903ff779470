//! The last seconds of the force loop, in bounded memory, and what can be said of its timing.

use crate::format;
use std::collections::VecDeque;
use stylet_shm_schema::TickRecord;

/// Seconds that the plots show.
pub const WINDOW_S: f64 = 10.0;
/// Ticks kept for the plots: a loop that ran at 2 kHz would still fit.
const KEPT_TICKS: usize = 20_000;
/// Ticks that percentiles are taken over: one minute at 1 kHz, so that p99.9 has samples beyond it.
const KEPT_TIMINGS: usize = 60_000;
/// A percentile with fewer samples beyond it is a guess and is not told.
const SAMPLES_BEYOND: f64 = 10.0;

#[derive(Clone, Copy, Debug)]
pub struct Tick {
    pub time_ns: u64,
    pub resistance_n: f32,
    pub depth_mm: f32,
    pub wake_us: f32,
    pub work_us: f32,
}

/// Of one quantity, in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Percentiles {
    pub p50: Option<f64>,
    pub p99: Option<f64>,
    pub p999: Option<f64>,
    pub max: Option<f64>,
}

#[derive(Clone, Debug, Default)]
pub struct Timing {
    pub samples: usize,
    pub wake: Percentiles,
    pub work: Percentiles,
    /// Counts by [`bin_low_us`].
    pub wake_histogram: [u32; BINS],
    pub work_histogram: [u32; BINS],
}

#[derive(Default)]
pub struct History {
    ticks: VecDeque<Tick>,
    /// Wake latency and work, ns, cut off at four seconds.
    timings: VecDeque<[u32; 2]>,
    /// Of them, kept up as they come and go.
    histograms: [[u32; BINS]; 2],
    session: u64,
    pub missed: u64,
    pub timing: Timing,
    scratch: Vec<u32>,
}

impl History {
    /// `direction` is the needle's, because records carry the force as a vector only.
    pub fn take(&mut self, records: &[TickRecord], direction: [f64; 3]) {
        for r in records {
            if r.session_id != self.session {
                *self = Self {
                    session: r.session_id,
                    ..Self::default()
                };
            }
            self.missed += u64::from(r.missed);
            let along: f64 = r.force_on_hand_n.iter().zip(direction).map(|(f, d)| f * d).sum();
            push_bounded(
                &mut self.ticks,
                KEPT_TICKS,
                Tick {
                    time_ns: r.due_ns,
                    resistance_n: -along as f32,
                    depth_mm: format::mm(r.depth_m) as f32,
                    wake_us: format::us(r.wake_latency_ns) as f32,
                    work_us: format::us(r.work_ns) as f32,
                },
            );
            let cut = |ns: u64| u32::try_from(ns).unwrap_or(u32::MAX);
            let timing = [cut(r.wake_latency_ns), cut(r.work_ns)];
            let gone = push_bounded(&mut self.timings, KEPT_TIMINGS, timing);
            for (which, histogram) in self.histograms.iter_mut().enumerate() {
                histogram[bin(timing[which])] += 1;
                if let Some(gone) = gone {
                    histogram[bin(gone[which])] -= 1;
                }
            }
        }
    }

    /// Percentiles and histogram; a good part of a millisecond, so not in each frame.
    pub fn sum_up(&mut self) {
        let mut of = |which: usize| {
            self.scratch.clear();
            self.scratch.extend(self.timings.iter().map(|t| t[which]));
            percentiles(&mut self.scratch)
        };
        let [wake_histogram, work_histogram] = self.histograms;
        self.timing = Timing {
            samples: self.timings.len(),
            wake: of(0),
            work: of(1),
            wake_histogram,
            work_histogram,
        };
    }

    /// At most two points for each of `buckets`: its smallest and largest, in the order of time. x is seconds before the newest tick.
    pub fn decimated(&self, buckets: usize, value: impl Fn(&Tick) -> f32) -> Vec<[f64; 2]> {
        let Some(newest) = self.ticks.back().map(|t| t.time_ns) else {
            return Vec::new();
        };
        let point = |tick: &Tick| {
            let x = -format::seconds(newest.saturating_sub(tick.time_ns));
            [x, f64::from(value(tick))]
        };
        let seen = |tick: &Tick| newest.saturating_sub(tick.time_ns) as f64 <= WINDOW_S * 1e9;
        let first = self.ticks.partition_point(|tick| !seen(tick));
        let points = self.ticks.range(first..).map(point);
        decimated(points, [-WINDOW_S, 0.0], buckets)
    }
}

/// At most two points for each of `buckets` between the ends: its smallest and largest, in the order of x.
pub fn decimated(points: impl Iterator<Item = [f64; 2]>, [from, to]: [f64; 2], buckets: usize) -> Vec<[f64; 2]> {
    let mut kept = Vec::with_capacity(2 * buckets + 2);
    let mut bucket = Bucket::default();
    let per_x = buckets as f64 / (to - from);
    for [x, y] in points {
        let index = ((x - from) * per_x) as usize;
        if index != bucket.index {
            bucket.flush(&mut kept);
            bucket.index = index;
        }
        bucket.add([x, y]);
    }
    bucket.flush(&mut kept);
    kept
}

/// Gives what had to make room.
fn push_bounded<T>(queue: &mut VecDeque<T>, limit: usize, item: T) -> Option<T> {
    let gone = (queue.len() >= limit).then(|| queue.pop_front()).flatten();
    queue.push_back(item);
    gone
}

#[derive(Default)]
struct Bucket {
    index: usize,
    low: Option<[f64; 2]>,
    high: Option<[f64; 2]>,
}

impl Bucket {
    fn add(&mut self, point: [f64; 2]) {
        if self.low.is_none_or(|p| point[1] < p[1]) {
            self.low = Some(point);
        }
        if self.high.is_none_or(|p| point[1] > p[1]) {
            self.high = Some(point);
        }
    }

    fn flush(&mut self, out: &mut Vec<[f64; 2]>) {
        let (Some(low), Some(high)) = (self.low.take(), self.high.take()) else {
            return;
        };
        if low == high {
            out.push(low);
        } else if low[0] <= high[0] {
            out.extend([low, high]);
        } else {
            out.extend([high, low]);
        }
    }
}

/// Of samples in ns, which lose their order.
fn percentiles(samples: &mut [u32]) -> Percentiles {
    let count = samples.len();
    let us = |ns: u32| format::us(u64::from(ns));
    // What lies before the last percentile need not be looked at for the next.
    let mut before = 0;
    let mut at = |share: f64| {
        let beyond = count as f64 * (1.0 - share);
        // A hair below, because 1 - 0.999 is not exact.
        if beyond < SAMPLES_BEYOND - 1e-6 {
            return None;
        }
        let rank = ((count as f64 * share).ceil() as usize).saturating_sub(1);
        let (_, ns, _) = samples[before..].select_nth_unstable(rank - before);
        before = rank;
        Some(us(*ns))
    };
    let (p50, p99, p999) = (at(0.5), at(0.99), at(0.999));
    let max = samples[before..].iter().max().map(|&ns| us(ns));
    Percentiles { p50, p99, p999, max }
}

/// Bins from 1 us up, five for each decade; the last takes all above.
pub const BINS: usize = 25;

pub fn bin_low_us(bin: usize) -> f64 {
    10.0_f64.powf(bin as f64 / 5.0)
}

fn bin(ns: u32) -> usize {
    let us = format::us(u64::from(ns)).max(1.0);
    ((us.log10() * 5.0) as usize).min(BINS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn records(count: u64) -> Vec<TickRecord> {
        (0..count)
            .map(|tick| TickRecord {
                session_id: 1,
                tick,
                due_ns: tick * 1_000_000,
                wake_latency_ns: tick,
                ..TickRecord::zeroed()
            })
            .collect()
    }

    #[test]
    fn memory_is_bounded_and_drawing_is_decimated() {
        let mut history = History::default();
        history.take(&records(100_000), [0.0, 0.0, 1.0]);
        assert_eq!(history.ticks.len(), KEPT_TICKS);
        assert_eq!(history.timings.len(), KEPT_TIMINGS);
        assert!(history.decimated(300, |t| t.wake_us).len() <= 602);
    }

    #[test]
    fn a_percentile_needs_ten_samples_beyond_it() {
        let mut history = History::default();
        history.take(&records(9_999), [0.0, 0.0, 1.0]);
        history.sum_up();
        assert_eq!(history.timing.wake.p999, None);
        assert!(history.timing.wake.p99.is_some());
        history.take(&records(1), [0.0, 0.0, 1.0]);
        history.sum_up();
        assert!(history.timing.wake.p999.is_some());
        history.take(&records(5), [0.0; 3]);
        assert_eq!(history.timing.samples, 10_000);
    }

    /// Against all of the last minute, sorted and counted.
    #[test]
    fn percentiles_and_histogram_are_those_of_what_is_kept() {
        let mut history = History::default();
        let mut given = Vec::new();
        let mut wake_ns = 12_345_u64;
        for count in [7, 1_500, 58_000, 30_000] {
            let mut some = records(count);
            for r in &mut some {
                wake_ns = wake_ns
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                r.wake_latency_ns = (wake_ns >> 33) % [900, 80_000, 40_000_000][(wake_ns >> 20) as usize % 3];
                given.push(r.wake_latency_ns);
            }
            history.take(&some, [0.0; 3]);
            history.sum_up();
            let mut kept = given[given.len().saturating_sub(KEPT_TIMINGS)..].to_vec();
            kept.sort_unstable();
            let rank = |share: f64| (kept.len() as f64 * share).ceil() as usize - 1;
            let told = |share: f64| (kept.len() as f64 * (1.0 - share) >= 9.99).then(|| format::us(kept[rank(share)]));
            let wake = history.timing.wake;
            assert_eq!([wake.p50, wake.p99, wake.p999], [0.5, 0.99, 0.999].map(told), "{count}");
            assert_eq!(wake.max, kept.last().map(|&ns| format::us(ns)));
            for (n, count) in history.timing.wake_histogram.into_iter().enumerate() {
                let low = if n == 0 { 0.0 } else { bin_low_us(n) };
                let high = if n + 1 == BINS { f64::MAX } else { bin_low_us(n + 1) };
                let inside = |ns: &&u64| (low..high).contains(&format::us(**ns));
                assert_eq!(count as usize, kept.iter().filter(inside).count(), "bin {n}");
            }
        }
    }

    #[test]
    fn another_session_starts_afresh() {
        let mut history = History::default();
        history.take(&records(100), [0.0; 3]);
        let mut other = records(1);
        other[0].session_id = 2;
        history.take(&other, [0.0; 3]);
        assert_eq!(history.ticks.len(), 1);
    }
}
