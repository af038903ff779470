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
    pub wake_histogram: Vec<u32>,
    pub work_histogram: Vec<u32>,
}

#[derive(Default)]
pub struct History {
    ticks: VecDeque<Tick>,
    /// Wake latency and work, ns, cut off at four seconds.
    timings: VecDeque<[u32; 2]>,
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
            push_bounded(
                &mut self.timings,
                KEPT_TIMINGS,
                [cut(r.wake_latency_ns), cut(r.work_ns)],
            );
        }
    }

    /// Percentiles and histogram; some milliseconds of work, so not in each frame.
    pub fn sum_up(&mut self) {
        let mut of = |which: usize| {
            self.scratch.clear();
            self.scratch.extend(self.timings.iter().map(|t| t[which]));
            self.scratch.sort_unstable();
            (percentiles(&self.scratch), histogram(&self.scratch))
        };
        let ((work, work_histogram), (wake, wake_histogram)) = (of(1), of(0));
        self.timing = Timing {
            samples: self.timings.len(),
            wake,
            work,
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
        let points = self.ticks.iter().map(point).filter(|[x, _]| *x >= -WINDOW_S);
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

fn push_bounded<T>(queue: &mut VecDeque<T>, limit: usize, item: T) {
    if queue.len() >= limit {
        queue.pop_front();
    }
    queue.push_back(item);
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

/// `sorted` in ns.
fn percentiles(sorted: &[u32]) -> Percentiles {
    let at = |share: f64| {
        let beyond = sorted.len() as f64 * (1.0 - share);
        // A hair below, because 1 - 0.999 is not exact.
        if beyond < SAMPLES_BEYOND - 1e-6 {
            return None;
        }
        let rank = (sorted.len() as f64 * share).ceil() as usize;
        sorted.get(rank.saturating_sub(1)).map(|&ns| format::us(u64::from(ns)))
    };
    Percentiles {
        p50: at(0.5),
        p99: at(0.99),
        p999: at(0.999),
        max: sorted.last().map(|&ns| format::us(u64::from(ns))),
    }
}

/// Bins from 1 us up, five for each decade; the last takes all above.
pub const BINS: usize = 25;

pub fn bin_low_us(bin: usize) -> f64 {
    10.0_f64.powf(bin as f64 / 5.0)
}

fn histogram(sorted: &[u32]) -> Vec<u32> {
    let mut counts = vec![0; BINS];
    for &ns in sorted {
        let us = format::us(u64::from(ns)).max(1.0);
        let bin = ((us.log10() * 5.0) as usize).min(BINS - 1);
        counts[bin] += 1;
    }
    counts
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
