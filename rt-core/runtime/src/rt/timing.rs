//! Times of each tick of a loop, sent through a ring to a measurement; a loop that is not measured has no probe.

use crate::rt::clock;
use crate::rt::pin::Toggle;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Stages of a tick at most.
pub const MAX_STAGES: usize = 6;

/// Times of one tick, `CLOCK_MONOTONIC`, ns.
#[derive(Clone, Copy, Debug, Default)]
pub struct TickTimes {
    /// When the tick was due.
    pub due_ns: u64,
    /// When its thread woke.
    pub woke_ns: u64,
    marks: [u64; MAX_STAGES],
    marked: usize,
    /// From input to output; `None` if there was no input yet.
    pub path_ns: Option<u64>,
    /// Time at which the output had left.
    pub output_ns: Option<u64>,
    /// Before and after a pin was toggled in this tick.
    pub toggled_ns: Option<[u64; 2]>,
    /// Cost of handing over the tick before.
    pub recording_ns: u64,
    /// Deadlines skipped just before this tick.
    pub missed: u32,
    /// Ticks so far for which the ring had no room.
    pub lost: u32,
}

impl TickTimes {
    /// Ends of the stages.
    pub fn marks(&self) -> &[u64] {
        self.marks.get(..self.marked).unwrap_or_default()
    }

    /// End of the last stage, or the wake-up if none has ended.
    pub fn done_ns(&self) -> u64 {
        self.marks().last().copied().unwrap_or(self.woke_ns)
    }

    /// Adds a mark; those past [`MAX_STAGES`] are dropped.
    pub fn push_mark(&mut self, time_ns: u64) {
        if let Some(mark) = self.marks.get_mut(self.marked) {
            *mark = time_ns;
            self.marked += 1;
        }
    }
}

/// Read times of the poses used by the last tissue ticks; written by the tissue thread, read by a host thread.
#[derive(Debug)]
pub struct PoseTimes([(AtomicU64, AtomicU64); PoseTimes::KEPT]);

impl PoseTimes {
    const KEPT: usize = 1024;

    fn note(&self, tick: u64, time_ns: u64) {
        let (slot_tick, slot_time) = &self.0[tick as usize % Self::KEPT];
        slot_time.store(time_ns, Ordering::Relaxed);
        // SYNC: pairs with the acquire load in `of`: who sees the tick sees its time.
        slot_tick.store(tick, Ordering::Release);
    }

    /// Returns when the tip pose behind tissue tick `tick` was read; `None` once it is forgotten.
    pub fn of(&self, tick: u64) -> Option<u64> {
        let (slot_tick, slot_time) = &self.0[tick as usize % Self::KEPT];
        // SYNC: pairs with the release store in `note`.
        let same = slot_tick.load(Ordering::Acquire) == tick;
        (same && tick > 0).then(|| slot_time.load(Ordering::Relaxed))
    }
}

impl Default for PoseTimes {
    fn default() -> Self {
        Self(std::array::from_fn(|_| Default::default()))
    }
}

/// Owned by a loop while it is measured.
pub struct Probe {
    ring: rtrb::Producer<TickTimes>,
    tick: TickTimes,
    pose_times: Arc<PoseTimes>,
    toggle: Option<Toggle>,
}

impl Probe {
    /// `ring` takes the ticks, `pose_times` the poses behind tissue ticks.
    pub fn new(ring: rtrb::Producer<TickTimes>, pose_times: Arc<PoseTimes>) -> Self {
        Self {
            ring,
            tick: TickTimes::default(),
            pose_times,
            toggle: None,
        }
    }

    /// Adds a pin that the loop toggles once its output has left.
    pub fn with_toggle(self, toggle: Option<Toggle>) -> Self {
        Self { toggle, ..self }
    }

    /// Ends a stage; call at the same places of every tick.
    pub fn mark(&mut self) {
        self.tick.push_mark(clock::now_ns());
    }

    /// Records that the tick's output left at the last mark; the path to it began at mark number `from`.
    pub fn output_since_mark(&mut self, from: usize) {
        let done_ns = self.tick.done_ns();
        self.tick.output_ns = Some(done_ns);
        self.tick.path_ns = self.tick.marks().get(from).map(|begin| done_ns.saturating_sub(*begin));
        if let Some(toggle) = &mut self.toggle {
            let before_ns = clock::now_ns();
            if toggle.tick() {
                self.tick.toggled_ns = Some([before_ns, clock::now_ns()]);
            }
        }
    }

    /// Records that the output of tissue tick `tick` left at the last mark, in answer to the tip read at `pose_ns`; 0
    /// for no tip yet.
    pub fn output_for_pose(&mut self, tick: u64, pose_ns: u64) {
        let done_ns = self.tick.done_ns();
        self.tick.output_ns = Some(done_ns);
        self.tick.path_ns = (pose_ns > 0).then(|| done_ns.saturating_sub(pose_ns));
        self.pose_times.note(tick, pose_ns);
    }

    /// Ends the last stage and hands over the tick.
    pub fn finish(&mut self, due_ns: u64, woke_ns: u64, missed: u32) {
        self.mark();
        let done_ns = self.tick.done_ns();
        self.tick.due_ns = due_ns;
        self.tick.woke_ns = woke_ns;
        self.tick.missed = missed;
        let full = self.ring.push(self.tick).is_err();
        let lost = self.tick.lost + u32::from(full);
        self.tick = TickTimes {
            recording_ns: clock::now_ns().saturating_sub(done_ns),
            lost,
            ..TickTimes::default()
        };
    }
}

/// Probes of all loops.
pub struct Probes {
    /// For the loop of the second device, if the run has one.
    pub second: Option<Probe>,
    /// For the force loop.
    pub haptic: Probe,
    /// For the tissue loop.
    pub tissue: Probe,
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_heap as heap;

    #[test]
    fn handing_over_makes_no_heap_call_and_counts_what_does_not_fit() {
        let (into, mut ring) = rtrb::RingBuffer::new(8);
        let mut probe = Probe::new(into, Arc::default());
        let before = heap::calls_of_this_thread();
        for tick in 1..=11 {
            probe.mark();
            probe.output_for_pose(tick, 0);
            probe.finish(1, 1, 0);
        }
        assert_eq!(heap::calls_of_this_thread() - before, 0);
        while ring.pop().is_ok() {}
        probe.finish(1, 1, 0);
        let last = ring.pop().expect("room again");
        assert_eq!(last.lost, 3);
        assert!(last.recording_ns > 0 && last.marks().len() == 1);
    }

    #[test]
    fn path_runs_from_its_mark_to_the_last_one() {
        let (into, mut ring) = rtrb::RingBuffer::new(2);
        let mut probe = Probe::new(into, Arc::default());
        for _ in 0..4 {
            probe.mark();
        }
        probe.output_since_mark(1);
        probe.finish(0, 0, 0);
        let tick = ring.pop().expect("one tick");
        assert_eq!(tick.path_ns, Some(tick.marks()[3] - tick.marks()[1]));
        assert_eq!(tick.output_ns, Some(tick.marks()[3]));
        assert_eq!(tick.done_ns(), tick.marks()[4]);
    }

    #[test]
    fn pose_times_are_known_until_they_are_overwritten() {
        let times = PoseTimes::default();
        times.note(3, 77);
        assert_eq!((times.of(3), times.of(4)), (Some(77), None));
        times.note(3 + PoseTimes::KEPT as u64, 78);
        assert_eq!(times.of(3), None);
    }
}
