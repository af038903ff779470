//! What each tick of a loop cost: histograms, windows and worst ticks of fixed size, so that recording allocates nothing.

use crate::rt::clock;
use hdrhistogram::Histogram;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Longest time that a histogram tells apart; longer ones count as this.
const LONGEST_NS: u64 = 10_000_000_000;
/// Three digits: a value is known to 0.1 %.
const DIGITS: u8 = 3;
/// Stages of a tick at most.
pub const MAX_STAGES: usize = 6;
/// Latest wake-ups that are kept one by one.
pub const WORST_KEPT: usize = 16;

/// A histogram of nanoseconds with fixed bounds, its pages touched.
pub fn histogram() -> Histogram<u64> {
    let mut h = Histogram::new_with_bounds(1, LONGEST_NS, DIGITS).expect("the bounds are constants that fit");
    // Touching every page now keeps the first record of a rare value from faulting one in the loop.
    for power in 0..34 {
        for step in 0..8 {
            h.saturating_record((1 << power) + (step << power) / 8);
        }
    }
    h.reset();
    h
}

/// What is asked of the timing of one loop.
#[derive(Clone, Copy, Debug)]
pub struct TimingPlan {
    /// Ticks at the start that count as warming up and are not recorded.
    pub warm_up_ticks: u64,
    pub window_ns: u64,
    pub windows: usize,
}

/// The worst of a stretch of time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Window {
    pub worst_wake_ns: u64,
    pub worst_work_ns: u64,
    pub missed: u32,
    pub ticks: u32,
}

/// One of the latest wake-ups.
#[derive(Clone, Copy, Debug, Default)]
pub struct LateTick {
    pub due_ns: u64,
    pub wake_ns: u64,
    pub work_ns: u64,
}

/// What a run is asked to measure.
#[derive(Clone, Debug)]
pub struct Measure {
    pub haptic: TimingPlan,
    pub tissue: TimingPlan,
    pub pose_times: Arc<PoseTimes>,
}

/// When the pose that each of the last tissue ticks used was read; written by the tissue thread, read by a host thread.
#[derive(Debug)]
pub struct PoseTimes([(AtomicU64, AtomicU64); PoseTimes::KEPT]);

impl PoseTimes {
    const KEPT: usize = 1024;

    pub fn new() -> Self {
        Self(std::array::from_fn(|_| (AtomicU64::new(0), AtomicU64::new(0))))
    }

    fn note(&self, tick: u64, time_ns: u64) {
        let (slot_tick, slot_time) = &self.0[tick as usize % Self::KEPT];
        slot_time.store(time_ns, Ordering::Relaxed);
        // SYNC: pairs with the acquire load in `of`: who sees the tick sees its time.
        slot_tick.store(tick, Ordering::Release);
    }

    /// `CLOCK_MONOTONIC` of the tip pose behind tissue tick `tick`; `None` once it is forgotten.
    pub fn of(&self, tick: u64) -> Option<u64> {
        let (slot_tick, slot_time) = &self.0[tick as usize % Self::KEPT];
        // SYNC: pairs with the release store in `note`.
        let same = slot_tick.load(Ordering::Acquire) == tick;
        (same && tick > 0).then(|| slot_time.load(Ordering::Relaxed))
    }
}

impl Default for PoseTimes {
    fn default() -> Self {
        Self::new()
    }
}

/// Timing of one loop, owned by its thread until the loop ends.
pub struct LoopTiming {
    /// Names of the stages, in the order of the tick.
    pub stage_names: &'static [&'static str],
    pub wake: Histogram<u64>,
    pub stages: [Histogram<u64>; MAX_STAGES],
    /// From wake-up to the end of the tick, without the recording below.
    pub work: Histogram<u64>,
    /// Haptic: device read to force written. Tissue: tip read by the haptic loop to response published.
    pub path: Histogram<u64>,
    /// Due time to force written (haptic), or to response published (tissue).
    pub due_to_output: Histogram<u64>,
    /// Difference between the interval of two wake-ups and the period.
    pub jitter: Histogram<u64>,
    /// What recording itself costs a tick.
    pub recording: Histogram<u64>,
    pub windows: Vec<Window>,
    pub worst: [LateTick; WORST_KEPT],
    /// Only the tissue loop writes them.
    pose_times: Arc<PoseTimes>,
    pub first_due_ns: u64,
    pub ticks: u64,
    pub missed: u64,
    /// Ticks that ended after the next one was due.
    pub overruns: u64,
    /// Ticks that found their time already past: they did not sleep.
    pub unslept: u64,
    plan: TimingPlan,
    period_ns: u64,
    seen: u64,
    last_woke_ns: u64,
    marks: [u64; MAX_STAGES],
    marked: usize,
    path_ns: Option<u64>,
    output_ns: Option<u64>,
}

impl LoopTiming {
    pub fn new(
        stage_names: &'static [&'static str],
        period_ns: u64,
        plan: TimingPlan,
        pose_times: Arc<PoseTimes>,
    ) -> Self {
        assert!(stage_names.len() <= MAX_STAGES, "at most {MAX_STAGES} stages");
        let mut windows = vec![Window { ticks: 1, ..Window::default() }; plan.windows.max(1)];
        windows.fill(Window::default());
        Self {
            stage_names,
            wake: histogram(),
            stages: std::array::from_fn(|_| histogram()),
            work: histogram(),
            path: histogram(),
            due_to_output: histogram(),
            jitter: histogram(),
            recording: histogram(),
            windows,
            worst: [LateTick::default(); WORST_KEPT],
            pose_times,
            first_due_ns: 0,
            ticks: 0,
            missed: 0,
            overruns: 0,
            unslept: 0,
            plan,
            period_ns,
            seen: 0,
            last_woke_ns: 0,
            marks: [0; MAX_STAGES],
            marked: 0,
            path_ns: None,
            output_ns: None,
        }
    }

    /// Ends a stage; call at the same places of every tick.
    pub fn mark(&mut self) {
        if self.marked < MAX_STAGES {
            self.marks[self.marked] = clock::now_ns();
            self.marked += 1;
        }
    }

    /// The tick's output left at the last mark; the way to it began at mark number `from`.
    pub fn output_since_mark(&mut self, from: usize) {
        let last = self.marks[self.marked.saturating_sub(1)];
        self.output_ns = Some(last);
        self.path_ns = Some(last - self.marks[from]);
    }

    /// The tissue's output left at the last mark, and answers the tip as it was at `pose_ns`; 0 for no tip yet.
    pub fn output_for_pose(&mut self, tick: u64, pose_ns: u64) {
        let last = self.marks[self.marked.saturating_sub(1)];
        self.output_ns = Some(last);
        self.path_ns = (pose_ns > 0).then(|| last.saturating_sub(pose_ns));
        self.pose_times.note(tick, pose_ns);
    }

    /// Ends the last stage and records the tick. `missed`: deadlines skipped just before it.
    pub fn finish(&mut self, due_ns: u64, woke_ns: u64, missed: u32, slept: bool) {
        self.mark();
        let done_ns = self.marks[self.marked - 1];
        self.seen += 1;
        if self.seen > self.plan.warm_up_ticks {
            self.record(due_ns, woke_ns, done_ns, missed, slept);
            self.recording.saturating_record(clock::now_ns() - done_ns);
        }
        self.last_woke_ns = woke_ns;
        (self.marked, self.path_ns, self.output_ns) = (0, None, None);
    }

    fn record(&mut self, due_ns: u64, woke_ns: u64, done_ns: u64, missed: u32, slept: bool) {
        let (wake_ns, work_ns) = (woke_ns.saturating_sub(due_ns), done_ns - woke_ns);
        if self.ticks == 0 {
            self.first_due_ns = due_ns;
        }
        self.ticks += 1;
        self.missed += u64::from(missed);
        self.overruns += u64::from(done_ns > due_ns + self.period_ns);
        self.unslept += u64::from(!slept);
        self.wake.saturating_record(wake_ns);
        self.work.saturating_record(work_ns);
        let mut before = woke_ns;
        for (histogram, &mark) in self.stages.iter_mut().zip(&self.marks[..self.marked]) {
            histogram.saturating_record(mark - before);
            before = mark;
        }
        if let Some(path_ns) = self.path_ns {
            self.path.saturating_record(path_ns);
        }
        if let Some(output_ns) = self.output_ns {
            self.due_to_output.saturating_record(output_ns.saturating_sub(due_ns));
        }
        if self.last_woke_ns > 0 {
            let interval_ns = woke_ns - self.last_woke_ns;
            self.jitter.saturating_record(interval_ns.abs_diff(self.period_ns));
        }
        self.note_window(due_ns, wake_ns, work_ns, missed);
        self.note_worst(LateTick { due_ns, wake_ns, work_ns });
    }

    fn note_window(&mut self, due_ns: u64, wake_ns: u64, work_ns: u64, missed: u32) {
        let index = (due_ns.saturating_sub(self.first_due_ns) / self.plan.window_ns) as usize;
        if let Some(window) = self.windows.get_mut(index) {
            window.worst_wake_ns = window.worst_wake_ns.max(wake_ns);
            window.worst_work_ns = window.worst_work_ns.max(work_ns);
            window.missed += missed;
            window.ticks += 1;
        }
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

impl std::fmt::Debug for LoopTiming {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "LoopTiming of {} ticks", self.ticks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rt::heap;

    const PLAN: TimingPlan = TimingPlan {
        warm_up_ticks: 2,
        window_ns: 10_000,
        windows: 4,
    };

    fn timing() -> LoopTiming {
        LoopTiming::new(&["a", "b"], 1_000, PLAN, Arc::default())
    }

    /// A tick due at `due_ns` that wakes `wake_ns` late.
    fn tick(timing: &mut LoopTiming, due_ns: u64, wake_ns: u64, missed: u32) {
        timing.mark();
        timing.finish(due_ns, due_ns + wake_ns, missed, true);
    }

    #[test]
    fn recording_makes_no_heap_call_whatever_the_values_are() {
        let mut timing = timing();
        let before = heap::calls_of_this_thread();
        for power in 0..33 {
            tick(&mut timing, 1_000, 1 << power, 1);
        }
        assert_eq!(heap::calls_of_this_thread() - before, 0);
        assert_eq!(timing.ticks, 31);
    }

    #[test]
    fn latest_wake_ups_are_kept_in_order() {
        let mut timing = timing();
        let mut all = Vec::new();
        for i in 0..200_u64 {
            let wake_ns = i * 7919 % 1009;
            tick(&mut timing, 1_000 * i, wake_ns, 0);
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
    fn windows_count_from_the_first_recorded_tick_and_end_with_their_number() {
        let mut timing = timing();
        for i in 0..100_u64 {
            tick(&mut timing, 1_000 * i, i, u32::from(i == 15));
        }
        // Ticks 2 to 11 are the first window of 10 us.
        assert_eq!(timing.windows[0].worst_wake_ns, 11);
        assert_eq!(timing.windows[1].missed, 1);
        assert_eq!(timing.windows.iter().map(|w| w.ticks).sum::<u32>(), 40);
    }

    #[test]
    fn pose_times_are_known_until_they_are_overwritten() {
        let times = PoseTimes::new();
        times.note(3, 77);
        assert_eq!((times.of(3), times.of(4)), (Some(77), None));
        times.note(3 + PoseTimes::KEPT as u64, 78);
        assert_eq!(times.of(3), None);
    }
}
