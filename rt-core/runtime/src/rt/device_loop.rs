//! Common part of every loop that owns a device: ticks on the ideal grid, and the end at zero force.

use crate::rt::hand::HandDevice;
#[cfg(not(target_family = "wasm"))]
pub use run::run;
use stylet_shm_schema::DeadlineTotals;

#[cfg(not(target_family = "wasm"))]
mod run;

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
