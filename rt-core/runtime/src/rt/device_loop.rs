//! Common part of every loop that owns a device: ticks on the ideal grid, and the end at zero force.

use crate::rt::arm::Armed;
use crate::rt::clock::{self, Grid};
use crate::rt::hand::HandDevice;
use std::sync::atomic::{AtomicBool, Ordering};
use stylet_shm_schema::DeadlineTotals;

/// Ticks of a loop, and their lateness.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Ticks made.
    pub ticks: u64,
    /// Deadlines missed and worst wake-up since the loop began.
    pub since_start: DeadlineTotals,
    /// Deadlines since the force was last turned on.
    pub since_armed: DeadlineTotals,
}

/// A loop that owns a device.
pub trait DeviceLoop {
    /// State shown to hosts.
    type State: bytemuck::Pod + Send;
    /// Phase within a period of the clock.
    const PHASE: f64;
    /// Returns the state shown to hosts, after the newest tick.
    fn state(&self) -> &Self::State;
    /// Returns the counts since the loop began; a reset does not clear them.
    fn counts(&self) -> Counts;
    /// Returns the device.
    fn device(&mut self) -> &mut HandDevice;
    /// Number of ticks of the ramp to zero force.
    fn ramp_out_ticks(&self) -> u32;
    /// Begins the ramp to zero force.
    fn release_for_the_end(&mut self);
    /// Runs one tick.
    fn step(&mut self, due_ns: u64, woke_ns: u64, missed: u32);
    /// Sets zero force, and hands over the flight recording.
    fn end(&mut self);
}

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
