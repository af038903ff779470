//! Cost of this program's own pictures in the graphics library and its driver: bytes and processor
//! time.

use crate::cpu_time::thread_ns;

/// Cost since the window opened.
#[derive(Clone, Copy, Debug, Default)]
pub struct DriverCost {
    pub uploaded_bytes: u64,
    pub cpu_ns: u64,
}

impl DriverCost {
    /// Runs calls of the driver and measures them.
    pub fn time<T>(&mut self, calls: impl FnOnce() -> T) -> T {
        let begun_ns = thread_ns();
        let result = calls();
        self.cpu_ns += thread_ns().saturating_sub(begun_ns);
        result
    }

    /// Like [`DriverCost::time`], for calls that return the number of bytes they sent.
    pub fn send(&mut self, calls: impl FnOnce() -> u64) {
        self.uploaded_bytes += self.time(calls);
    }

    pub fn plus(self, other: Self) -> Self {
        Self {
            uploaded_bytes: self.uploaded_bytes + other.uploaded_bytes,
            cpu_ns: self.cpu_ns + other.cpu_ns,
        }
    }
}
