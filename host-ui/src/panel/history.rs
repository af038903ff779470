//! The last seconds of the force loop, in bounded memory, and statistics of its timing.

use hdrhistogram::Histogram;
use std::collections::VecDeque;
use stylet_base::envelope::{Band, Envelope};
use stylet_base::format;
use stylet_base::seen::{Seen, TickOrder};
use stylet_shm_schema::TickRecord;

/// Time span of the plots, in seconds.
pub const WINDOW_S: f64 = 10.0;
const WINDOW_NS: u64 = WINDOW_S as u64 * 1_000_000_000;
/// Time of one place of a plot: 250 of them fill its width.
const SLOT_NS: u64 = WINDOW_NS / 250;
/// Number of ticks in percentiles: one minute at 1 kHz, so that p99.9 has samples beyond it.
const KEPT_TICKS: u64 = 60_000;
/// Fewest samples beyond a percentile; with fewer it would be a guess and is not shown.
const SAMPLES_BEYOND: f64 = 10.0;
/// Significant digits of a percentile.
const DIGITS: u8 = 3;

/// Plotted quantity.
#[derive(Clone, Copy, Debug)]
pub enum Quantity {
    ResistanceN,
    DepthMm,
    WakeUs,
}

impl Quantity {
    /// Every quantity, in the order of the variants; each has its plot.
    pub const ALL: [Self; 3] = [Self::ResistanceN, Self::DepthMm, Self::WakeUs];

    /// Returns the value of a tick; `direction` is the needle's.
    fn of(self, r: &TickRecord, direction: [f64; 3]) -> f64 {
        match self {
            Self::ResistanceN => -r.force_on_hand_n.iter().zip(direction).map(|(f, d)| f * d).sum::<f64>(),
            Self::DepthMm => format::mm(r.depth_m),
            Self::WakeUs => format::us(r.wake_latency_ns),
        }
    }
}

/// Percentiles of one quantity, in microseconds, to three digits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Percentiles {
    pub p50: Option<f64>,
    pub p99: Option<f64>,
    pub p999: Option<f64>,
    pub max: Option<f64>,
}

#[derive(Clone, Debug, Default)]
pub struct Timing {
    /// Share of the ticks of the last minute that were seen.
    pub seen: Seen,
    pub wake: Percentiles,
    pub work: Percentiles,
    /// Counts by [`bin_low_us`].
    pub wake_histogram: [u32; BINS],
    pub work_histogram: [u32; BINS],
}

pub struct History {
    curves: Envelope<{ Quantity::ALL.len() }>,
    /// Number of each tick, with its wake latency and work, ns, saturated at four seconds.
    timings: VecDeque<(u64, [u32; 2])>,
    counts: [LastMinute; 2],
    session: u64,
    order: TickOrder,
    /// First and last tick of the session that were seen.
    ticks: Option<[u64; 2]>,
    pub missed: u64,
    pub timing: Timing,
}

impl Default for History {
    fn default() -> Self {
        Self {
            curves: Envelope::new(SLOT_NS),
            timings: VecDeque::new(),
            counts: [(); 2].map(|()| LastMinute::new()),
            session: 0,
            order: TickOrder::default(),
            ticks: None,
            missed: 0,
            timing: Timing::default(),
        }
    }
}

impl History {
    /// Takes records. `direction` is the needle's, because records carry the force as a vector
    /// only.
    pub fn take(&mut self, records: &[TickRecord], direction: [f64; 3]) {
        for r in records {
            if r.session_id != self.session {
                *self = Self {
                    session: r.session_id,
                    ..Self::default()
                };
            }
            self.missed += u64::from(r.missed);
            if self.order.missing_before(r.session_id, r.tick) > 0 {
                self.curves.gap();
            }
            let [first, last] = self.ticks.unwrap_or([r.tick; 2]);
            self.ticks = Some([first, last.max(r.tick)]);
            let plotted = Quantity::ALL.map(|quantity| quantity.of(r, direction) as f32);
            self.curves.add(r.due_ns, plotted);
            let timing = [r.wake_latency_ns, r.work_ns].map(|ns| u32::try_from(ns).unwrap_or(u32::MAX));
            self.timings.push_back((r.tick, timing));
            for (which, counts) in self.counts.iter_mut().enumerate() {
                counts.add(timing[which]);
            }
            self.expire(r.tick);
        }
        if let Some(newest_ns) = self.curves.newest_ns() {
            self.curves.forget_before(newest_ns.saturating_sub(WINDOW_NS));
        }
    }

    /// Removes ticks older than a minute of ticks, whether seen or not.
    fn expire(&mut self, newest: u64) {
        while let Some(&(tick, timing)) = self.timings.front()
            && tick + KEPT_TICKS <= newest
        {
            self.timings.pop_front();
            for (which, counts) in self.counts.iter_mut().enumerate() {
                counts.drop(timing[which]);
            }
        }
    }

    /// Returns how many of the ticks of the last minute were seen.
    fn seen(&self) -> Seen {
        let seen = self.timings.len() as u64;
        let ran = self.ticks.map_or(0, |[first, last]| (last - first + 1).min(KEPT_TICKS));
        Seen {
            seen,
            unseen: ran.saturating_sub(seen),
        }
    }

    /// Computes percentiles over tens of thousands of counts. Called rarely, because text that
    /// changes in each frame is illegible.
    pub fn sum_up(&mut self) {
        let [wake, work] = self.counts.each_mut().map(LastMinute::percentiles);
        let [wake_histogram, work_histogram] = self.counts.each_ref().map(|c| c.bins);
        self.timing = Timing {
            seen: self.seen(),
            wake,
            work,
            wake_histogram,
            work_histogram,
        };
    }

    /// Returns the age of a time before the newest tick, s; `None` if it is not plotted.
    pub fn before_s(&self, time_ns: u64) -> Option<f64> {
        let newest_ns = self.curves.newest_ns()?;
        let before_s = format::seconds(newest_ns.saturating_sub(time_ns));
        (before_s <= WINDOW_S).then_some(-before_s)
    }

    pub fn curve(&self, quantity: Quantity) -> Vec<Vec<[f64; 3]>> {
        let newest_ns = self.curves.newest_ns().unwrap_or(0);
        let before = |time_ns: u64| -format::seconds(newest_ns.saturating_sub(time_ns));
        let piece = |bands: &Vec<Band>| {
            let points = bands.iter();
            let points = points.map(|b| [before(b.time_ns), f64::from(b.low), f64::from(b.high)]);
            points.filter(|[x, ..]| *x >= -WINDOW_S).collect::<Vec<_>>()
        };
        let pieces = self.curves.pieces(quantity as usize);
        pieces.iter().map(piece).filter(|piece| !piece.is_empty()).collect()
    }
}

/// Histogram of the ticks that are kept.
struct LastMinute {
    /// Counts that still include those in `expired`, which are subtracted all at once.
    all: Histogram<u32>,
    expired: Histogram<u32>,
    bins: [u32; BINS],
}

impl LastMinute {
    fn new() -> Self {
        let empty = || Histogram::new_with_bounds(1, u64::from(u32::MAX), DIGITS).expect("bounds that fit");
        Self {
            all: empty(),
            expired: empty(),
            bins: [0; BINS],
        }
    }

    fn add(&mut self, ns: u32) {
        self.all.saturating_record(u64::from(ns));
        self.bins[bin(ns)] += 1;
    }

    fn drop(&mut self, ns: u32) {
        self.expired.saturating_record(u64::from(ns));
        self.bins[bin(ns)] -= 1;
    }

    fn percentiles(&mut self) -> Percentiles {
        self.all
            .subtract(&self.expired)
            .expect("every expired sample was recorded");
        self.expired.reset();
        let all = &self.all;
        let us = |ns: u64| format::us(ns.min(u64::from(u32::MAX)));
        let at = |share: f64| {
            let beyond = all.len() as f64 * (1.0 - share);
            // Slightly lowered, because 1 - 0.999 is not exact.
            (beyond >= SAMPLES_BEYOND - 1e-6).then(|| us(all.value_at_quantile(share)))
        };
        Percentiles {
            p50: at(0.5),
            p99: at(0.99),
            p999: at(0.999),
            max: (!all.is_empty()).then(|| us(all.max())),
        }
    }
}

/// Number of bins from 1 us up, five for each decade; the last one has no upper limit.
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

    fn records(ticks: std::ops::Range<u64>) -> Vec<TickRecord> {
        ticks
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
    fn curves_stand_in_the_order_of_their_quantities() {
        assert!(
            Quantity::ALL
                .iter()
                .enumerate()
                .all(|(n, quantity)| *quantity as usize == n)
        );
    }

    #[test]
    fn memory_is_bounded_and_the_curves_reach_from_end_to_end() {
        let mut history = History::default();
        history.take(&records(0..100_000), [0.0, 0.0, 1.0]);
        assert_eq!(history.timings.len() as u64, KEPT_TICKS);
        let curve = history.curve(Quantity::WakeUs).concat();
        assert!((249..=251).contains(&curve.len()), "{}", curve.len());
        let [x, low, high] = curve[curve.len() - 1];
        assert!((-0.02..=0.0).contains(&x) && low < high && high == f64::from(99.999_f32));
        assert!(
            curve[0][0] >= -WINDOW_S && curve[0][0] < -WINDOW_S + 0.04,
            "{:?}",
            curve[0]
        );
    }

    #[test]
    fn a_percentile_needs_ten_samples_beyond_it() {
        let mut history = History::default();
        history.take(&records(0..9_999), [0.0, 0.0, 1.0]);
        history.sum_up();
        assert_eq!(history.timing.wake.p999, None);
        assert!(history.timing.wake.p99.is_some());
        history.take(&records(9_999..10_000), [0.0, 0.0, 1.0]);
        history.sum_up();
        assert!(history.timing.wake.p999.is_some());
        history.take(&records(10_000..10_005), [0.0; 3]);
        assert_eq!(history.timing.seen.seen, 10_000);
    }

    /// Compares with a sort of the whole last minute.
    #[test]
    fn percentiles_and_histogram_match_the_kept_ticks() {
        let mut history = History::default();
        let mut given = Vec::new();
        let mut random = stylet_random::Random(1);
        for count in [7, 1_500, 58_000, 30_000] {
            let first = given.len() as u64;
            let mut some = records(first..first + count);
            for r in &mut some {
                let most_ns = [900, 80_000, 40_000_000][random.below(3)];
                r.wake_latency_ns = random.below(most_ns) as u64;
                given.push(r.wake_latency_ns);
            }
            history.take(&some, [0.0; 3]);
            history.sum_up();
            let mut kept = given[given.len().saturating_sub(KEPT_TICKS as usize)..].to_vec();
            kept.sort_unstable();
            let rank = |share: f64| (kept.len() as f64 * share).ceil() as usize - 1;
            let rank_value =
                |share: f64| (kept.len() as f64 * (1.0 - share) >= 9.99).then(|| format::us(kept[rank(share)]));
            let wake = history.timing.wake;
            let largest = kept.last().map(|&ns| format::us(ns));
            let sorted = [rank_value(0.5), rank_value(0.99), rank_value(0.999), largest];
            for (shown, sorted) in [wake.p50, wake.p99, wake.p999, wake.max].into_iter().zip(sorted) {
                let off = shown
                    .zip(sorted)
                    .map_or(0.0, |(shown, sorted)| (shown - sorted) / sorted);
                assert!(
                    shown.is_some() == sorted.is_some() && off.abs() <= 1e-3,
                    "{shown:?} {sorted:?}"
                );
            }
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
        history.take(&records(0..100), [0.0; 3]);
        let mut other = records(0..1);
        other[0].session_id = 2;
        history.take(&other, [0.0; 3]);
        assert_eq!(history.timings.len(), 1);
        assert_eq!(history.curve(Quantity::DepthMm).concat().len(), 1);
    }

    /// Guards against a last minute of 60 000 records, however many ticks had run between them.
    #[test]
    fn the_last_minute_counts_seen_and_unseen_ticks() {
        let mut history = History::default();
        // Of every 128 ticks 64 are seen.
        for block in 0..1_000 {
            history.take(&records(block * 128..block * 128 + 64), [0.0; 3]);
        }
        history.sum_up();
        let seen = history.timing.seen;
        assert_eq!(seen.ran(), KEPT_TICKS);
        assert!(seen.seen.abs_diff(KEPT_TICKS / 2) <= 64, "{}", seen.words());
        let counted: u32 = history.timing.wake_histogram.iter().sum();
        assert_eq!(u64::from(counted), seen.seen);
        // In the last ten seconds no piece of a curve crosses a loss.
        let longest = history.curve(Quantity::WakeUs).iter().map(Vec::len).max();
        assert!(longest.is_some_and(|n| n <= 3), "{longest:?}");
    }
}
