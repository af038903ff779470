//! Errors of a driver as its servo thread notes them, and whether they cost the connection.

use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

/// Written by the servo thread; the keeper sets and clears the loss as well.
#[derive(Debug, Default)]
pub struct Errors {
    lost: AtomicBool,
    /// The driver's last error by number, 0 for none.
    last: AtomicU32,
    count: AtomicU64,
}

impl Errors {
    /// Notes an error of the driver.
    pub fn note(&self, code: u32) {
        // SYNC: relaxed; `set_lost` publishes the code where that matters, the count is for display.
        self.last.store(code, Ordering::Relaxed);
        self.count.fetch_add(1, Ordering::Relaxed);
    }

    /// Declares the connection lost. Servo thread, or the keeper when the servo loop is silent.
    pub fn set_lost(&self) {
        // SYNC: release pairs with the acquire in `lost`.
        self.lost.store(true, Ordering::Release);
    }

    /// As [`set_lost`](Self::set_lost), for a loss that no call reported.
    pub fn set_lost_by_status(&self) {
        // SYNC: relaxed; the release in `set_lost` publishes it.
        self.last.store(0, Ordering::Relaxed);
        self.set_lost();
    }

    /// There is a new connection. Keeper, before the servo loop starts.
    pub fn clear_lost(&self) {
        // SYNC: relaxed; the start of the servo loop publishes it.
        self.lost.store(false, Ordering::Relaxed);
    }

    /// Whether the connection is lost, for the servo thread.
    pub fn is_lost(&self) -> bool {
        // SYNC: relaxed; set by this thread, or by the keeper, which then needs no more than that it arrives.
        self.lost.load(Ordering::Relaxed)
    }

    /// The driver's error behind a lost connection, if the connection is lost.
    pub fn lost(&self) -> Option<u32> {
        // SYNC: acquire pairs with the release in `set_lost`: the error that caused the loss is visible.
        self.lost.load(Ordering::Acquire).then(|| self.last())
    }

    /// The driver's last error by number, 0 for none.
    pub fn last(&self) -> u32 {
        // SYNC: relaxed; one value for display, or ordered by `lost`.
        self.last.load(Ordering::Relaxed)
    }

    /// Number of errors so far.
    pub fn count(&self) -> u64 {
        // SYNC: relaxed; one value for display. Its partner is `note`.
        self.count.load(Ordering::Relaxed)
    }
}
