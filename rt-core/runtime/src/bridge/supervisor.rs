//! Detects that the haptic loop itself has stopped: the one fault that the loop cannot detect.
//!
//! It runs in the bridge, at normal priority. A loop that stands still leaves its last force on the device; so the
//! process ends, and the device's own watchdog, or the closing of its port, takes the force away.

/// Passes of the bridge without one tick of the loop; 2 ms and more each.
///
/// Passes, not time: while the whole process is stopped, neither advances.
const PATIENCE_PASSES: u32 = 125;
/// The same for a loop of normal priority that moves no motors: a busy machine keeps it from its processor for longer than that, and what
/// is late there is not dead.
const PATIENCE_PASSES_UNHURRIED: u32 = 1000;

/// One for a bridge.
pub struct Supervisor {
    patience_passes: u32,
    without_tick: u32,
}

impl Supervisor {
    /// Of a loop that runs in real time or not, over a device that is simulated or not.
    pub fn new(is_real_time: bool, is_simulated: bool) -> Self {
        Self {
            patience_passes: match is_simulated && !is_real_time {
                true => PATIENCE_PASSES_UNHURRIED,
                false => PATIENCE_PASSES,
            },
            without_tick: 0,
        }
    }

    /// One pass; true when the loop must be taken for dead.
    pub fn pass(&mut self, made_a_tick: bool) -> bool {
        self.without_tick = if made_a_tick { 0 } else { self.without_tick + 1 };
        self.without_tick >= self.patience_passes
    }
}

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

    /// On two cores that built other programs a core without real time ended itself while a client watched, after 9, 13 and 410 s.
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
}
