//! Collects the times of each tick into histograms, windows and the latest wake-ups; at normal priority.

use crate::sample::{Batched, PARTS, Sample, late_from_ns};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};
use stylet_runtime::rt::timing::{MAX_STAGES, TickTimes};

/// Latest wake-ups that are kept one by one.
pub const WORST_KEPT: usize = 16;
/// Most late wake-ups that are kept in the order of time.
const LATE_KEPT: usize = 1 << 14;
/// Pause between two rounds that empty the ring; it holds seconds.
const PAUSE: Duration = Duration::from_millis(5);

/// Plan by which ticks are gathered.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub period_ns: u64,
    /// Ticks at the start that count as warming up and are left out.
    pub warm_up_ticks: u64,
    pub window_ns: u64,
    pub windows: usize,
    /// Grid points of the run as planned.
    pub grid: u64,
}

/// The worst of a stretch of time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Window {
    pub worst_wake_ns: u64,
    pub worst_work_ns: u64,
    pub missed: u32,
    pub overruns: u32,
    pub ticks: u32,
}

/// One of the latest wake-ups.
#[derive(Clone, Copy, Debug, Default)]
pub struct LateTick {
    pub due_ns: u64,
    pub wake_ns: u64,
    pub work_ns: u64,
}

/// A toggle: the deadline of its tick, and our clock before and after the pin was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ToggleTime {
    pub due_ns: u64,
    pub before_ns: u64,
    pub after_ns: u64,
}

/// Everything measured of one loop.
pub struct LoopTiming {
    /// Names of the stages, in the order of the tick.
    pub stage_names: &'static [&'static str],
    pub wake: Batched,
    pub stages: [Batched; MAX_STAGES],
    /// Time from wake-up to the end of the tick, without the measurement itself.
    pub work: Batched,
    /// Haptic: device read to force written. Tissue: tip read by the haptic loop to response published.
    pub path: Batched,
    /// Due time to force written (haptic), or to response published (tissue).
    pub due_to_output: Batched,
    /// Difference between the interval of two wake-ups and the period.
    pub jitter: Batched,
    /// Cost of the measurement for the loop in each tick.
    pub recording: Batched,
    pub windows: Vec<Window>,
    pub worst: [LateTick; WORST_KEPT],
    /// The first late wake-ups, in the order of time.
    pub late_wakes: Vec<LateTick>,
    /// Wake-ups in the order of time.
    pub sample: Sample,
    pub first_due_ns: u64,
    last_due_ns: u64,
    pub ticks: u64,
    pub missed: u64,
    /// Ticks that ended after the next one was due.
    pub overruns: u64,
    /// Ticks that did not fit into the ring.
    pub lost: u64,
    /// Times at which the loop toggled its pin, warm-up included.
    pub toggles: Vec<ToggleTime>,
    /// Channel for ticks late by this many nanoseconds, wake-up and work together.
    late: Option<(u64, Sender<LateTick>)>,
    late_ns: u64,
    plan: Plan,
    seen: u64,
    last_woke_ns: u64,
}

impl LoopTiming {
    pub fn new(stage_names: &'static [&'static str], plan: Plan) -> Self {
        Self {
            stage_names,
            wake: Batched::default(),
            stages: std::array::from_fn(|_| Batched::default()),
            work: Batched::default(),
            path: Batched::default(),
            due_to_output: Batched::default(),
            jitter: Batched::default(),
            recording: Batched::default(),
            windows: vec![Window::default(); plan.windows],
            worst: [LateTick::default(); WORST_KEPT],
            late_wakes: Vec::with_capacity(LATE_KEPT),
            sample: Sample::default(),
            first_due_ns: 0,
            last_due_ns: 0,
            ticks: 0,
            missed: 0,
            overruns: 0,
            lost: 0,
            toggles: Vec::new(),
            late: None,
            late_ns: late_from_ns(plan.period_ns),
            plan,
            seen: 0,
            last_woke_ns: 0,
        }
    }

    /// Reports each tick that is late by `over_ns` to `late`, until gathering ends.
    pub fn report_late(&mut self, over_ns: u64, late: Sender<LateTick>) {
        self.late = Some((over_ns, late));
    }

    /// Gathers until the loop has ended and the ring is empty.
    pub fn gather(self, ring: rtrb::Consumer<TickTimes>) -> Self {
        self.gather_with(ring, Duration::MAX, |_| {})
    }

    /// Returns the same; `checkpoint` sees what was gathered so far, as often as `every`, and at the end.
    pub fn gather_with(
        mut self,
        mut ring: rtrb::Consumer<TickTimes>,
        every: Duration,
        checkpoint: impl Fn(&Self),
    ) -> Self {
        let mut begin = Instant::now();
        loop {
            let last = ring.is_abandoned();
            while let Ok(tick) = ring.pop() {
                self.take(&tick);
            }
            if last {
                self.late = None;
                checkpoint(&self);
                return self;
            }
            if begin.elapsed() >= every {
                checkpoint(&self);
                begin = Instant::now();
            }
            std::thread::sleep(PAUSE);
        }
    }

    /// Returns the length of the grid that was served or missed, without the warm-up, in nanoseconds.
    pub fn measured_ns(&self) -> u64 {
        match self.ticks {
            0 => 0,
            _ => self.last_due_ns - self.first_due_ns + self.plan.period_ns,
        }
    }

    /// Returns everything that has a histogram, by its name.
    pub fn all(&self) -> impl Iterator<Item = (&'static str, &Batched)> {
        let stages = self.stage_names.iter().copied().zip(&self.stages);
        let first = [("wake", &self.wake), ("jitter", &self.jitter)];
        let last = [
            ("work", &self.work),
            ("path", &self.path),
            ("due_to_output", &self.due_to_output),
            ("recording", &self.recording),
        ];
        first.into_iter().chain(stages).chain(last)
    }

    fn take(&mut self, tick: &TickTimes) {
        self.seen += 1;
        self.lost = u64::from(tick.lost);
        if let Some([before_ns, after_ns]) = tick.toggled_ns {
            self.toggles.push(ToggleTime {
                due_ns: tick.due_ns,
                before_ns,
                after_ns,
            });
        }
        if self.seen > self.plan.warm_up_ticks {
            self.record(tick);
        }
        self.last_woke_ns = tick.woke_ns;
    }

    fn record(&mut self, tick: &TickTimes) {
        let (due_ns, woke_ns, done_ns) = (tick.due_ns, tick.woke_ns, tick.done_ns());
        let (wake_ns, work_ns) = (woke_ns.saturating_sub(due_ns), done_ns - woke_ns);
        if self.ticks == 0 {
            self.first_due_ns = due_ns;
        }
        self.last_due_ns = due_ns;
        // Deadlines missed before the first tick lie before the measurement.
        let missed = if self.ticks == 0 { 0 } else { tick.missed };
        let is_overrun = done_ns > due_ns + self.plan.period_ns;
        self.ticks += 1;
        self.missed += u64::from(missed);
        self.overruns += u64::from(is_overrun);
        let place = due_ns.saturating_sub(self.first_due_ns) / self.plan.period_ns;
        let part = (place / self.plan.grid.div_ceil(PARTS as u64).max(1)) as usize;
        self.wake.take(part, wake_ns);
        self.work.take(part, work_ns);
        let mut before = woke_ns;
        for (histogram, &mark) in self.stages.iter_mut().zip(tick.marks()) {
            histogram.take(part, mark - before);
            before = mark;
        }
        if let Some(path_ns) = tick.path_ns {
            self.path.take(part, path_ns);
        }
        if let Some(output_ns) = tick.output_ns {
            self.due_to_output.take(part, output_ns.saturating_sub(due_ns));
        }
        if self.last_woke_ns > 0 {
            let interval_ns = woke_ns - self.last_woke_ns;
            self.jitter.take(part, interval_ns.abs_diff(self.plan.period_ns));
        }
        self.recording.take(part, tick.recording_ns);
        self.sample.take(wake_ns);
        self.note_window(due_ns, [wake_ns, work_ns], missed, is_overrun);
        let tick = LateTick {
            due_ns,
            wake_ns,
            work_ns,
        };
        if let Some((over_ns, late)) = &self.late
            && wake_ns + work_ns >= *over_ns
        {
            // The receiver may be gone.
            let _ = late.send(tick);
        }
        if wake_ns >= self.late_ns && self.late_wakes.len() < LATE_KEPT {
            self.late_wakes.push(tick);
        }
        self.note_worst(tick);
    }

    fn note_window(&mut self, due_ns: u64, [wake_ns, work_ns]: [u64; 2], missed: u32, is_overrun: bool) {
        let index = (due_ns.saturating_sub(self.first_due_ns) / self.plan.window_ns) as usize;
        // The last window takes all beyond the plan.
        let last = self.windows.len() - 1;
        let window = &mut self.windows[index.min(last)];
        window.worst_wake_ns = window.worst_wake_ns.max(wake_ns);
        window.worst_work_ns = window.worst_work_ns.max(work_ns);
        window.missed += missed;
        window.overruns += u32::from(is_overrun);
        window.ticks += 1;
    }

    /// Keeps the latest wake-ups, latest first.
    fn note_worst(&mut self, tick: LateTick) {
        if tick.wake_ns <= self.worst[WORST_KEPT - 1].wake_ns {
            return;
        }
        let place = self.worst.partition_point(|t| t.wake_ns >= tick.wake_ns);
        self.worst[place..].rotate_right(1);
        self.worst[place] = tick;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: Plan = Plan {
        period_ns: 1_000,
        warm_up_ticks: 2,
        window_ns: 10_000,
        windows: 4,
        grid: 100,
    };

    fn timing() -> LoopTiming {
        LoopTiming::new(&["a", "b"], PLAN)
    }

    /// Returns a tick due at `due_ns` that wakes `wake_ns` late and has stages of 100 and 200 ns.
    fn tick(due_ns: u64, wake_ns: u64, missed: u32) -> TickTimes {
        let woke_ns = due_ns + wake_ns;
        let mut tick = TickTimes::default();
        (tick.due_ns, tick.woke_ns, tick.missed) = (due_ns, woke_ns, missed);
        tick.push_mark(woke_ns + 100);
        tick.push_mark(woke_ns + 300);
        tick
    }

    #[test]
    fn stages_add_up_to_the_tick_and_lateness_to_an_overrun() {
        let mut timing = timing();
        for i in 0..10_u64 {
            timing.take(&tick(1_000 * i, if i == 7 { 800 } else { 10 }, 0));
        }
        assert_eq!(timing.ticks, 8);
        assert_eq!(
            [timing.stages[0].max(), timing.stages[1].max(), timing.work.max()],
            [100, 200, 300]
        );
        assert_eq!(timing.overruns, 1);
        // Woken 790 ns late, then 790 ns sooner again.
        assert_eq!(timing.jitter.count_at(790), 2);
        assert_eq!(timing.jitter.count_at(0), 6);
    }

    #[test]
    fn latest_wake_ups_are_kept_in_order() {
        let mut timing = timing();
        let mut all = Vec::new();
        for i in 0..200_u64 {
            let wake_ns = i * 7919 % 1009;
            timing.take(&tick(2_000 * i, wake_ns, 0));
            if i >= PLAN.warm_up_ticks {
                all.push(wake_ns);
            }
        }
        all.sort_unstable_by(|a, b| b.cmp(a));
        let kept: Vec<u64> = timing.worst.iter().map(|t| t.wake_ns).collect();
        assert_eq!(kept, all[..WORST_KEPT]);
        assert_eq!(timing.wake.max(), timing.wake.highest_equivalent(all[0]));
    }

    #[test]
    fn windows_count_each_recorded_tick_once() {
        let mut timing = timing();
        for i in 0..100_u64 {
            timing.take(&tick(1_000 * i, i, u32::from(i == 15)));
        }
        // Ticks 2 to 11 are the first window of 10 us.
        assert_eq!(timing.windows[0].worst_wake_ns, 11);
        assert_eq!(timing.windows[1].missed, 1);
        assert_eq!(timing.windows.iter().map(|w| w.ticks).sum::<u32>(), 98);
    }

    #[test]
    fn ticks_that_are_late_by_wake_up_and_work_together_are_reported() {
        let mut timing = timing();
        let (late, reported) = std::sync::mpsc::channel();
        timing.report_late(1_000, late);
        for (i, wake_ns) in [5_000, 5_000, 699, 700, 10, 2_000].into_iter().enumerate() {
            timing.take(&tick(10_000 * i as u64, wake_ns, 0));
        }
        // Each works for 300 ns; the first two are the warm-up.
        let wakes: Vec<u64> = reported.try_iter().map(|t| t.wake_ns).collect();
        assert_eq!(wakes, [700, 2_000]);
    }

    #[test]
    fn everything_in_the_ring_is_gathered_before_it_ends() {
        let (mut into, ring) = rtrb::RingBuffer::new(64);
        for i in 0..50 {
            into.push(tick(1_000 * i, 5, 0)).expect("room");
        }
        drop(into);
        assert_eq!(timing().gather(ring).ticks, 48);
    }
}
