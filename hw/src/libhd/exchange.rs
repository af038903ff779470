//! State that the servo thread, the force loop and the connector thread share without waiting.
//!
//! This file holds all atomics of the back end and their orderings, with two exceptions: the entry
//! flag of a servo thread ([`servo`](super::servo)) and the parts common to all back ends
//! ([`driver_thread`](crate::driver_thread)).

use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use crate::device::DeviceFault;
use crate::driver_thread::ends::FaultCell;
use crate::driver_thread::loss::Errors;
use crate::libhd::ffi::{Handle, INVALID_HANDLE};

/// Device that a callback serves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Served {
    pub handle: Handle,
    /// True if the device has motors in its gimbal.
    pub torques: bool,
}

/// State shared by three threads. Each field has one writer, named in its comment, unless the
/// comment says otherwise.
#[derive(Debug)]
pub struct Shared {
    /// Connector: device that callbacks serve, published by `release`.
    handle: AtomicU32,
    /// Connector: like `handle`.
    torques: AtomicBool,
    /// Connector: order to every callback to write zero force.
    release: AtomicBool,
    /// Order to the first callback to arm its thread; set by the connector before a scheduler
    /// starts, cleared by that callback.
    arm: AtomicBool,
    /// Servo: callbacks so far.
    calls: AtomicU64,
    /// Servo: callbacks that wrote zero because of `release` or `lost`.
    released: AtomicU64,
    /// Servo, and the connector while no callback runs.
    pub fault: FaultCell,
    /// Servo, and the connector when the servo loop is silent.
    pub errors: Errors,
    /// Servo: `f64` bits, like the next two.
    temperature: AtomicU64,
    speed: AtomicU64,
    worst_callback: AtomicU64,
}

impl Default for Shared {
    fn default() -> Self {
        Self {
            handle: AtomicU32::new(INVALID_HANDLE),
            torques: AtomicBool::new(false),
            release: AtomicBool::new(true),
            arm: AtomicBool::new(false),
            calls: AtomicU64::new(0),
            released: AtomicU64::new(0),
            fault: FaultCell::default(),
            errors: Errors::default(),
            temperature: AtomicU64::new(0),
            speed: AtomicU64::new(0),
            worst_callback: AtomicU64::new(0),
        }
    }
}

/// State of the driver, without the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings {
    /// Servo callbacks so far.
    pub calls: u64,
    /// Present fault.
    pub fault: Option<DeviceFault>,
    /// Last error of the driver by number; 0 for none.
    pub error: u32,
    /// Number of errors that the driver reported so far.
    pub errors: u64,
    /// Temperature of the warmest motor as a share of its limit, 0 to 1, as the driver predicts it.
    pub temperature: f64,
    /// Speed of the tip, m/s: the driver's own smoothed estimate.
    pub speed_m_per_s: f64,
    /// Longest time from the start of a servo tick to the end of its callback, s.
    pub worst_callback_s: f64,
}

/// Calls of the connector thread.
impl Shared {
    /// Lets the next callback arm its thread and serve `served`.
    pub fn serve(&self, served: Served) {
        // SYNC: relaxed; the release store below publishes these four.
        self.torques.store(served.torques, Ordering::Relaxed);
        self.handle.store(served.handle, Ordering::Relaxed);
        self.errors.clear_lost();
        self.arm.store(true, Ordering::Relaxed);
        // SYNC: release pairs with the acquire load in `served`: a callback that may exert a force sees the four above.
        self.release.store(false, Ordering::Release);
    }

    /// Makes every callback that begins after this write zero force.
    pub fn request_release(&self) {
        // SYNC: relaxed; the flag carries nothing with it. `released` confirms it.
        self.release.store(true, Ordering::Relaxed);
    }

    /// Returns the number of callbacks that wrote zero force because of `release` or `lost`.
    pub fn released(&self) -> u64 {
        // SYNC: acquire pairs with the release in `count_released`: the driver has the zero of every counted callback.
        self.released.load(Ordering::Acquire)
    }

    /// Returns the number of callbacks that have begun.
    pub fn calls(&self) -> u64 {
        // SYNC: relaxed; readers only look for a change. Its partner is `count_call`.
        self.calls.load(Ordering::Relaxed)
    }
}

/// Calls of the servo thread.
impl Shared {
    /// Counts a callback; returns how many came before.
    pub fn count_call(&self) -> u64 {
        // SYNC: relaxed; a counter. Its partner is `calls`.
        self.calls.fetch_add(1, Ordering::Relaxed)
    }

    /// Returns the device to serve, or `None` when this callback must write zero.
    pub fn served(&self) -> Option<Served> {
        // SYNC: acquire pairs with the release store in `serve`; it comes before every other load of this function and
        // before `take_arm`.
        let release = self.release.load(Ordering::Acquire);
        (!release && !self.errors.is_lost()).then(|| self.last_served())
    }

    /// Returns the device that was served last, released or not.
    pub fn last_served(&self) -> Served {
        // SYNC: relaxed; `served` has acquired them, and a callback that only writes zero may see the device before.
        Served {
            handle: self.handle.load(Ordering::Relaxed),
            torques: self.torques.load(Ordering::Relaxed),
        }
    }

    /// Returns true once after each `serve`.
    pub fn take_arm(&self) -> bool {
        // SYNC: relaxed; a callback that saw `release` cleared (acquire in `served`) sees this flag set.
        self.arm.swap(false, Ordering::Relaxed)
    }

    /// Counts a callback whose zero force the driver has.
    pub fn count_released(&self) {
        // SYNC: release pairs with the acquire in `released`.
        self.released.fetch_add(1, Ordering::Release);
    }

    /// Records the temperature of the warmest motor, 0 to 1.
    pub fn note_temperature(&self, share: f64) {
        // SYNC: relaxed; one value for display. Its partner is `readings`.
        self.temperature.store(share.to_bits(), Ordering::Relaxed);
    }

    /// Records the driver's estimate of the speed.
    pub fn note_speed_m_per_s(&self, speed: f64) {
        // SYNC: relaxed; one value for display. Its partner is `readings`.
        self.speed.store(speed.to_bits(), Ordering::Relaxed);
    }

    /// Records when a callback ended, counted from the start of its servo tick.
    pub fn note_callback_s(&self, time_s: f64) {
        if time_s > 0.0 {
            // The bits of positive numbers are in the order of the numbers.
            // SYNC: relaxed; one value for display. Its partner is `readings`.
            self.worst_callback.fetch_max(time_s.to_bits(), Ordering::Relaxed);
        }
    }
}

/// Calls of more than one thread.
impl Shared {
    /// Returns everything for display. The values may come from different ticks.
    pub fn readings(&self) -> Readings {
        // SYNC: relaxed; every value stands alone. The partners are the `note_` functions.
        let number = |bits: &AtomicU64| f64::from_bits(bits.load(Ordering::Relaxed));
        Readings {
            calls: self.calls(),
            fault: self.fault.get(),
            error: self.errors.last(),
            errors: self.errors.count(),
            temperature: number(&self.temperature),
            speed_m_per_s: number(&self.speed),
            worst_callback_s: number(&self.worst_callback),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_callback_serves_only_between_serve_and_release_or_loss() {
        let shared = Shared::default();
        let served = Served {
            handle: 7,
            torques: true,
        };
        assert_eq!((shared.served(), shared.take_arm()), (None, false));
        shared.serve(served);
        assert_eq!(shared.served(), Some(served));
        assert_eq!((shared.take_arm(), shared.take_arm()), (true, false), "armed once");
        shared.errors.note(0x0302);
        shared.errors.set_lost();
        assert_eq!((shared.served(), shared.errors.lost()), (None, Some(0x0302)));
        shared.serve(served);
        assert_eq!((shared.served(), shared.errors.lost()), (Some(served), None));
        shared.request_release();
        assert_eq!((shared.served(), shared.last_served()), (None, served));
    }
}
