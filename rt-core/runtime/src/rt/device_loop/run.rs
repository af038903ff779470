//! A loop that owns a device, on its own armed thread.

use super::DeviceLoop;
use crate::rt::arm::Armed;
use crate::rt::clock::{self, Grid};
use std::sync::atomic::{AtomicBool, Ordering};

/// Runs on the ideal grid until `stop`, then ramps the force to zero and ends. Returns the number of sleeps.
pub fn run<L: DeviceLoop>(
    device_loop: &mut L,
    _armed: &Armed,
    stop: &AtomicBool,
    mut publish: impl FnMut(&L::State),
) -> u64 {
    let (period_s, wait) = (device_loop.device().period_s, device_loop.device().wait);
    let period_ns = (period_s * 1e9).round() as u64;
    let mut grid = Grid::at_phase(clock::now_ns(), period_ns, clock::phase_ns(L::PHASE, period_ns));
    let (mut missed, mut sleeps) = (0, 0);
    let mut last_ticks = device_loop.ramp_out_ticks() + 1;
    while last_ticks > 0 {
        // SYNC: pairs with the control thread's release store; nothing but the flag is carried.
        if stop.load(Ordering::Acquire) {
            device_loop.release_for_the_end();
            last_ticks -= 1;
        }
        sleeps += wait.until(grid.due_ns);
        let woke_ns = clock::now_ns();
        device_loop.step(grid.due_ns, woke_ns, missed);
        publish(device_loop.state());
        if let Some(probe) = &mut device_loop.device().probe {
            probe.finish(grid.due_ns, woke_ns, missed);
        }
        missed = grid.advance(clock::now_ns());
    }
    device_loop.end();
    sleeps
}
