//! Detects that the haptic loop itself has stopped: the one fault that the loop cannot detect.
//!
//! It runs in the bridge, at normal priority. A loop that stands still leaves its last force on the device; so the
//! process ends, and the device's own watchdog, or the closing of its port, takes the force away.

/// Passes of the bridge without one tick of the loop; 2 ms and more each.
///
/// Passes, not time: while the whole process is stopped, neither advances.
pub const PATIENCE_PASSES: u32 = 125;

/// One for a bridge.
#[derive(Default)]
pub struct Supervisor {
    without_tick: u32,
}

impl Supervisor {
    /// One pass; true when the loop must be taken for dead.
    pub fn pass(&mut self, made_a_tick: bool) -> bool {
        self.without_tick = if made_a_tick { 0 } else { self.without_tick + 1 };
        self.without_tick >= PATIENCE_PASSES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_tick_in_time_is_enough_and_none_is_not() {
        let mut supervisor = Supervisor::default();
        for _ in 0..10 {
            assert!((1..PATIENCE_PASSES).all(|_| !supervisor.pass(false)));
            assert!(!supervisor.pass(true));
        }
        assert!((1..PATIENCE_PASSES).all(|_| !supervisor.pass(false)));
        assert!(supervisor.pass(false));
    }
}
