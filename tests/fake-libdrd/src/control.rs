//! Commands of a test to the fake, and reports of the fake to the test: one block of atomics.
//!
//! A block of zeros is a healthy omega.7 that does not move.

// SYNC: relaxed throughout; see `Block`.
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicI32, AtomicU32, AtomicU64};

pub use fake_control::{Block, get, put};

use crate::table::{COUNT, index_of};

/// Number of calls whose order is kept.
pub const CALLS_KEPT: usize = 4096;
/// Environment variable with the file of the block, for a fake in another process.
pub const VARIABLE: &str = "FAKE_LIBDRD_CONTROL";

/// The block. Arrays `fail`, `fail_times` and `calls` are indexed as [`FUNCTIONS`](crate::table::FUNCTIONS).
#[repr(C)]
pub struct Control {
    // Commands of the test:
    /// Error that the next `fail_times` calls of a function give, instead of having an effect.
    pub fail: [AtomicU32; COUNT],
    /// Number of calls that fail, by function.
    pub fail_times: [AtomicU32; COUNT],
    /// 1: the cable is unplugged.
    pub unplugged: AtomicU32,
    /// 1: another program has the device.
    pub in_use: AtomicU32,
    /// Type of the device; 0 is an omega.7.
    pub system_type: AtomicI32,
    /// Index into the status array, from 1, that has the value `status_number`; 0 for none.
    pub status_place: AtomicU32,
    /// See `status_place`.
    pub status_number: AtomicI32,
    /// Length of the status array; 0 is 17.
    pub status_count: AtomicU32,
    /// The firmware turns forces off once, for this cause.
    pub turn_off: AtomicU32,
    /// 1: forces cannot be turned on.
    pub stays_off: AtomicU32,
    /// 1 the position is not a number, 2 the matrix is not a rotation, 3 the position is a thousand kilometres away.
    pub bad_pose: AtomicU32,
    /// 1: the SDK reports success, and neither sends nor receives.
    pub frozen: AtomicU32,
    /// 1: the next call that sets a force does not return until this is 0.
    pub hang: AtomicU32,
    /// Time that each call takes.
    pub late_us: AtomicU32,
    /// 1: each pose repeats the one before.
    pub time_guard: AtomicU32,
    /// 1: the device has no watchdog.
    pub no_watchdog: AtomicU32,
    /// One bit per button.
    pub buttons: AtomicU32,
    /// Time of the firmware; 0 for the system's time.
    pub now_us: AtomicU64,
    /// Tip, m, device frame, as `f64` bits.
    pub tip_m: [AtomicU64; 3],
    /// Rotation of the handle about y, rad.
    pub turn_rad: AtomicU64,
    // Reports of the fake:
    /// Number of calls, by function.
    pub calls: [AtomicU64; COUNT],
    /// Number of successful openings.
    pub opens: AtomicU32,
    /// Number of calls with the number of a device that is not open.
    pub wrong_ids: AtomicU32,
    /// Number of calls of the expert interface without its mode.
    pub not_expert: AtomicU32,
    /// Number of calls while another call was under way.
    pub overlapping: AtomicU32,
    /// 1: forces are on.
    pub force_mode: AtomicU32,
    /// The watchdog, in units of 125 µs; 0 is none.
    pub watchdog_units: AtomicU32,
    /// Force, then torque, of the last call that reached the device.
    pub commanded: [AtomicU64; 6],
    /// Time of that call.
    pub commanded_us: AtomicU64,
    /// Largest force so far, N.
    pub peak_force_n: AtomicU64,
    /// Number of forces that were not finite.
    pub non_finite_forces: AtomicU64,
    /// Force when the device was last stopped, N.
    pub force_at_stop_n: AtomicU64,
    /// Number of all calls.
    pub call_count: AtomicU64,
    /// The functions of those calls, in their order.
    pub call_order: [AtomicU32; CALLS_KEPT],
}

// SAFETY: atomics of 4 and 8 bytes, and arrays of them.
unsafe impl Block for Control {
    const EXPORT: &str = "fake_drd_control";
}

impl Control {
    /// Makes the next `times` calls of `function` fail.
    pub fn fail(&self, function: &str, code: u32, times: u32) {
        let index = index_of(function);
        self.fail[index].store(code, Relaxed);
        self.fail_times[index].store(times, Relaxed);
    }

    /// Number of calls of `function`.
    pub fn calls_of(&self, function: &str) -> u64 {
        self.calls[index_of(function)].load(Relaxed)
    }

    /// Sets a value of the status array, index from 0.
    pub fn status(&self, place: usize, number: i32) {
        self.status_number.store(number, Relaxed);
        self.status_place.store(place as u32 + 1, Relaxed);
    }

    /// Returns the force that last reached the device, N, device frame.
    pub fn commanded_n(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| get(&self.commanded[axis]))
    }

    /// Returns the torque that last reached the device, N m, device frame.
    pub fn commanded_nm(&self) -> [f64; 3] {
        [3, 4, 5].map(|axis| get(&self.commanded[axis]))
    }

    /// True if the watchdog has expired at `now_us`.
    pub fn is_dropped(&self, now_us: u64) -> bool {
        let watchdog_us = u64::from(self.watchdog_units.load(Relaxed)) * 125;
        watchdog_us > 0 && now_us.saturating_sub(self.commanded_us.load(Relaxed)) > watchdog_us
    }

    /// Returns the force of the motors at `now_us`: zero if forces are off or the watchdog has expired.
    pub fn motors_n(&self, now_us: u64) -> [f64; 3] {
        if self.force_mode.load(Relaxed) == 0 || self.is_dropped(now_us) {
            [0.0; 3]
        } else {
            self.commanded_n()
        }
    }

    /// Names of the calls so far, up to the first `CALLS_KEPT`.
    pub fn order(&self) -> Vec<&'static str> {
        let count = self.call_count.load(Relaxed) as usize;
        let order = self.call_order.iter().take(count.min(CALLS_KEPT));
        order
            .map(|i| crate::table::FUNCTIONS[i.load(Relaxed) as usize].name)
            .collect()
    }
}
