//! Detects that the haptic loop itself has stopped: the one fault that the loop cannot detect.
//!
//! It runs in the control thread, at normal priority. A stopped loop leaves its last force on the device. With real
//! motors the process ends, and the device's own watchdog, or the closing of its port, removes the force. A simulated
//! device has no motors: the fault is reported, and the run continues with the force off when the loop resumes.

use super::{Control, LoopStopped};
use crate::rt::exchange::HapticOrder;
use stylet_shm_schema::{Event, EventKind, Fault, Text};

/// Passes of the control thread without one tick of the loop; 2 ms and more each.
///
/// Passes, not time: while the whole process is stopped, neither advances.
const PATIENCE_PASSES: u32 = 125;
/// Patience for a loop of normal priority that moves no motors: a busy machine keeps it off its core for longer, and a
/// late loop is not a dead one.
const PATIENCE_PASSES_UNHURRIED: u32 = 1000;

/// Counts passes without a tick, for one loop.
pub struct Supervisor {
    patience_passes: u32,
    without_tick: u32,
    is_simulated: bool,
    /// Hosts have been notified that the loop is stopped.
    is_reported: bool,
    /// The loop's order is still to be sent: its ring was full.
    owes_order: bool,
}

impl Supervisor {
    /// Returns a supervisor with the patience for this scheduling and device.
    pub fn new(is_real_time: bool, is_simulated: bool) -> Self {
        Self {
            patience_passes: match is_simulated && !is_real_time {
                true => PATIENCE_PASSES_UNHURRIED,
                false => PATIENCE_PASSES,
            },
            without_tick: 0,
            is_simulated,
            is_reported: false,
            owes_order: false,
        }
    }

    /// Counts one pass; true while the loop counts as dead.
    pub fn pass(&mut self, made_a_tick: bool) -> bool {
        self.without_tick = if made_a_tick { 0 } else { self.without_tick + 1 };
        self.without_tick >= self.patience_passes
    }

    /// Counts one pass; true on the first pass since the last tick at which the loop counts as dead.
    fn finds_stopped(&mut self, made_a_tick: bool) -> bool {
        let stands_still = self.pass(made_a_tick);
        let was_reported = std::mem::replace(&mut self.is_reported, stands_still);
        stands_still && !was_reported
    }
}

impl Control {
    /// Runs one pass. Fails when the run must end, to release a real device.
    pub(super) fn supervise(&mut self, made_a_tick: bool) -> Result<(), LoopStopped> {
        if self.supervisor.finds_stopped(made_a_tick) {
            let text = match self.supervisor.is_simulated {
                true => Fault::LoopStopped.message(),
                false => LOOP_ENDED,
            };
            self.link.event(Event {
                code: Fault::LoopStopped as u32,
                text: Text::new(text),
                ..self.link.event_now(EventKind::FaultRaised)
            });
            if !self.supervisor.is_simulated {
                return Err(LoopStopped);
            }
            eprintln!("rt-core: {text}");
            self.supervisor.owes_order = true;
        }
        if self.supervisor.owes_order && self.order_haptic(0, HapticOrder::StoodStill).is_ok() {
            self.supervisor.owes_order = false;
        }
        Ok(())
    }
}

/// Message to hosts and the terminal when the run ends.
pub(crate) const LOOP_ENDED: &str =
    "the force loop has stopped; rt-core ended, so that the device is released: start it again";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_tick_in_time_is_enough_and_none_is_not() {
        let mut supervisor = Supervisor::new(true, true);
        for _ in 0..10 {
            assert!((1..PATIENCE_PASSES).all(|_| !supervisor.pass(false)));
            assert!(!supervisor.pass(true));
        }
        assert!((1..PATIENCE_PASSES).all(|_| !supervisor.pass(false)));
        assert!(supervisor.pass(false));
    }

    /// On two cores that compiled other programs, a core without real time ended itself while a client was connected,
    /// after 9, 13 and 410 s.
    #[test]
    fn only_a_loop_of_normal_priority_without_motors_is_waited_for_longer() {
        let passes = |is_real_time, is_simulated| {
            let mut supervisor = Supervisor::new(is_real_time, is_simulated);
            (1..).find(|_| supervisor.pass(false))
        };
        for (is_real_time, is_simulated) in [(true, true), (true, false), (false, false)] {
            assert_eq!(passes(is_real_time, is_simulated), Some(PATIENCE_PASSES));
        }
        assert_eq!(passes(false, true), Some(PATIENCE_PASSES_UNHURRIED));
    }

    #[test]
    fn each_standstill_is_reported_once() {
        let mut supervisor = Supervisor::new(true, true);
        for _ in 0..2 {
            let reports = (0..3 * PATIENCE_PASSES).filter(|_| supervisor.finds_stopped(false));
            assert_eq!(reports.count(), 1);
            assert!(!supervisor.finds_stopped(true));
        }
    }
}
