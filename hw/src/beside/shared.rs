//! State that the servo thread, the force loop and the keeper share without waiting.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::beside::ends::FaultCell;
use crate::beside::loss::Errors;
use crate::device::DeviceFault;

/// Each field has one writer, which its comment names, unless it says otherwise.
#[derive(Debug, Default)]
pub struct Shared {
    /// Keeper: the servo thread goes on.
    serve: AtomicBool,
    /// Servo: ticks so far.
    ticks: AtomicU64,
    /// Servo: ticks in which the motors could not give all of the force.
    saturated: AtomicU64,
    /// Servo, and the keeper while no servo thread runs.
    pub fault: FaultCell,
    /// Servo, and the keeper when the servo loop is silent.
    pub errors: Errors,
}

impl Shared {
    /// Lets the next servo thread serve. Keeper, before it starts that thread.
    pub fn serve(&self) {
        self.errors.clear_lost();
        // SYNC: relaxed; starting the thread publishes it.
        self.serve.store(true, Ordering::Relaxed);
    }

    /// Ends the servo thread after its tick. Keeper.
    pub fn request_release(&self) {
        // SYNC: relaxed; the flag carries nothing with it. Joining the thread confirms it.
        self.serve.store(false, Ordering::Relaxed);
    }

    /// No device is connected. Keeper, while no servo thread runs.
    pub fn not_connected(&self) {
        self.fault.set(Some(DeviceFault::NotConnected));
    }

    /// The connection is closed; a fault that ended it stays the present one. Keeper, after the servo thread.
    pub fn released(&self) {
        if self.fault.get().is_none() {
            self.not_connected();
        }
    }

    /// Whether the servo thread goes on. Servo.
    pub fn serves(&self) -> bool {
        // SYNC: relaxed; the partner is `request_release`.
        self.serve.load(Ordering::Relaxed) && !self.errors.is_lost()
    }

    /// Counts a tick; returns how many came before. Servo.
    pub fn count_tick(&self) -> u64 {
        // SYNC: relaxed; a counter. Its partner is `ticks`.
        self.ticks.fetch_add(1, Ordering::Relaxed)
    }

    /// Number of ticks that have begun.
    pub fn ticks(&self) -> u64 {
        // SYNC: relaxed; only a change of the number is looked for. Its partner is `count_tick`.
        self.ticks.load(Ordering::Relaxed)
    }

    /// Counts a tick in which the motors could not give all of the force. Servo.
    pub fn count_saturated(&self) {
        // SYNC: relaxed; a counter for display. Its partner is `saturated`.
        self.saturated.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of ticks in which the motors could not give all of the force.
    pub fn saturated(&self) -> u64 {
        // SYNC: relaxed; one value for display. Its partner is `count_saturated`.
        self.saturated.load(Ordering::Relaxed)
    }
}
