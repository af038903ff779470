//! Errors that the servo thread records, and the loss of the connection that they may cause.

use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

/// Error state, written by the servo thread; the keeper sets and clears the loss as well.
#[derive(Debug, Default)]
pub struct Errors {
    lost: AtomicBool,
    /// Last error of the driver by number; 0 for none.
    last: AtomicU32,
    count: AtomicU64,
}

impl Errors {
    /// Records an error of the driver.
    pub fn note(&self, code: u32) {
        // SYNC: relaxed; `set_lost` publishes the code where a reader acts on it, the count is for
        // display.
        self.last.store(code, Ordering::Relaxed);
        self.count.fetch_add(1, Ordering::Relaxed);
    }

    /// Declares the connection lost. Called by the servo thread, or by the keeper when the servo
    /// loop is silent.
    pub fn set_lost(&self) {
        // SYNC: release pairs with the acquire in `lost`.
        self.lost.store(true, Ordering::Release);
    }

    /// Like [`set_lost`](Self::set_lost), for a loss that no call reported.
    pub fn set_lost_by_status(&self) {
        // SYNC: relaxed; the release in `set_lost` publishes it.
        self.last.store(0, Ordering::Relaxed);
        self.set_lost();
    }

    /// Clears the loss after a reconnection. Called by the keeper before the servo loop starts.
    pub fn clear_lost(&self) {
        // SYNC: relaxed; the start of the servo loop publishes it.
        self.lost.store(false, Ordering::Relaxed);
    }

    /// Returns whether the connection is lost. Called by the servo thread.
    pub fn is_lost(&self) -> bool {
        // SYNC: relaxed; set by this thread, or by the keeper, which needs only that the flag
        // arrives.
        self.lost.load(Ordering::Relaxed)
    }

    /// Returns the driver's error behind a lost connection, if the connection is lost.
    pub fn lost(&self) -> Option<u32> {
        // SYNC: acquire pairs with the release in `set_lost`: the error that caused the loss is visible to the load after
        // it.
        self.lost
            .load(Ordering::Acquire)
            .then(|| self.last.load(Ordering::Relaxed))
    }

    /// Returns the number of errors so far.
    pub fn count(&self) -> u64 {
        // SYNC: relaxed; one value for display. Its partner is `note`.
        self.count.load(Ordering::Relaxed)
    }
}
