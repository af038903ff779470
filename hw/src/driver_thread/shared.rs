//! State that the servo thread, the force loop and the keeper share without waiting.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::device::DeviceFault;
use crate::driver_thread::ends::FaultCell;
use crate::driver_thread::loss::Errors;

/// State shared by three threads. Each field has one writer, named in its comment, unless the
/// comment says otherwise.
#[derive(Debug, Default)]
pub struct Shared {
    /// Keeper: permission for the servo thread to continue.
    serve: AtomicBool,
    /// Servo: ticks so far.
    ticks: AtomicU64,
    /// Servo, and the keeper while no servo thread runs.
    pub fault: FaultCell,
    /// Servo, and the keeper when the servo loop is silent.
    pub errors: Errors,
}

impl Shared {
    /// Lets the next servo thread serve. Called by the keeper before it starts that thread.
    pub fn serve(&self) {
        self.errors.clear_lost();
        // SYNC: release pairs with the acquire in `serves`: what the keeper wrote before is visible to a thread that serves.
        self.serve.store(true, Ordering::Release);
    }

    /// Ends the servo thread after its tick. Called by the keeper.
    pub fn request_release(&self) {
        // SYNC: relaxed; the flag carries nothing with it. Joining the thread confirms it.
        self.serve.store(false, Ordering::Relaxed);
    }

    /// Publishes that no device is connected. Called by the keeper while no servo thread runs.
    pub fn not_connected(&self) {
        self.fault.set(Some(DeviceFault::NotConnected));
    }

    /// Publishes that the connection is closed; a fault that ended it remains the present one.
    /// Called by the keeper after the servo thread ended.
    pub fn released(&self) {
        if self.fault.get().is_none() {
            self.not_connected();
        }
    }

    /// Returns whether the servo thread continues. Called by the servo thread.
    pub fn serves(&self) -> bool {
        // SYNC: acquire pairs with the release in `serve`.
        self.serve.load(Ordering::Acquire) && !self.errors.is_lost()
    }

    /// Counts a tick; returns how many came before. Called by the servo thread.
    pub fn count_tick(&self) -> u64 {
        // SYNC: relaxed; a counter. Its partner is `ticks`.
        self.ticks.fetch_add(1, Ordering::Relaxed)
    }

    /// Returns the number of ticks that have begun.
    pub fn ticks(&self) -> u64 {
        // SYNC: relaxed; readers only look for a change. Its partner is `count_tick`.
        self.ticks.load(Ordering::Relaxed)
    }
}
