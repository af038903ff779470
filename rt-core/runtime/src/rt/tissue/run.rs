//! The tissue loop on its own armed thread.

use super::TissueLoop;
use crate::rt::arm::Armed;
use crate::rt::clock::{self, Grid, Wait};
use std::sync::atomic::{AtomicBool, Ordering};

impl TissueLoop {
    /// Runs on the ideal grid until `stop`. Returns the number of sleeps.
    pub fn run(&mut self, _armed: &Armed, stop: &AtomicBool) -> u64 {
        let mut grid = Grid::at_phase(clock::now_ns(), (self.period_s * 1e9).round() as u64, self.phase_ns);
        let (mut missed, mut sleeps) = (0, 0);
        // SYNC: pairs with the control thread's release store; nothing but the flag is carried.
        while !stop.load(Ordering::Acquire) {
            sleeps += Wait::default().until(grid.due_ns);
            let woke_ns = clock::now_ns();
            self.count(missed, woke_ns.saturating_sub(grid.due_ns));
            self.tick(woke_ns);
            if let Some(probe) = &mut self.probe {
                probe.finish(grid.due_ns, woke_ns, missed);
            }
            missed = grid.advance(clock::now_ns());
        }
        self.hand_over_tape();
        sleeps
    }

    fn count(&mut self, missed: u32, wake_latency_ns: u64) {
        let response = &mut self.state.response;
        response.missed += u64::from(missed);
        response.worst_wake_ns = response.worst_wake_ns.max(wake_latency_ns);
        response.since_start.add(missed, wake_latency_ns);
        response.since_armed.add(missed, wake_latency_ns);
    }
}
