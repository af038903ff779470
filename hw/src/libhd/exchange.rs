//! What the servo thread, the force loop and the keeper hand each other without waiting.

use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use crate::device::{DeviceFault, Wrench};
use crate::libhd::ffi::INVALID_HANDLE;

/// The newest wrench, and how many have been written.
#[derive(Debug, Clone, Copy, Default)]
pub struct Command {
    pub wrench: Wrench,
    pub number: u64,
}

/// Written by one side each, as named; every value stands for itself, so the order between them does not matter
/// but where a comment says so.
#[derive(Debug)]
pub struct Shared {
    /// Keeper: the device that callbacks serve.
    pub handle: AtomicU32,
    /// Keeper: the device has motors in its gimbal.
    pub torques: AtomicBool,
    /// Keeper: every callback writes zero force.
    pub release: AtomicBool,
    /// Keeper sets it before it starts a scheduler; the first callback takes it and arms its thread.
    pub arm: AtomicBool,
    /// Servo: callbacks so far.
    pub calls: AtomicU64,
    /// Servo: callbacks that wrote zero because of `release`.
    pub released: AtomicU64,
    /// Servo, and keeper while no callback runs: a [`DeviceFault`] by number, 0 for none.
    fault: AtomicU32,
    /// Servo: the connection is lost; taken by the keeper.
    pub lost: AtomicBool,
    /// Servo: the driver's last error, 0 for none, and how many there were.
    pub error: AtomicU32,
    pub errors: AtomicU64,
    /// Servo: `f64` bits.
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
            fault: AtomicU32::new(DeviceFault::NotConnected.code()),
            lost: AtomicBool::new(false),
            error: AtomicU32::new(0),
            errors: AtomicU64::new(0),
            temperature: AtomicU64::new(0),
            speed: AtomicU64::new(0),
            worst_callback: AtomicU64::new(0),
        }
    }
}

/// What the driver says of itself beside the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings {
    pub calls: u64,
    pub fault: Option<DeviceFault>,
    /// The driver's last error by number, 0 for none.
    pub error: u32,
    pub errors: u64,
    /// Of the warmest motor, 0 to 1, as the driver predicts it.
    pub temperature: f64,
    /// The driver's own estimate, smoothed.
    pub speed_m_per_s: f64,
    /// The longest that a callback ended after its servo tick began.
    pub worst_callback_s: f64,
}

// SYNC: relaxed throughout; no other memory is handed over through these values. Samples and commands go through
// triple buffers, which pair release with acquire by themselves.
const ORDER: Ordering = Ordering::Relaxed;

impl Shared {
    pub fn fault(&self) -> Option<DeviceFault> {
        let code = self.fault.load(ORDER);
        FAULTS.iter().copied().find(|f| f.code() == code)
    }

    pub fn set_fault(&self, fault: Option<DeviceFault>) {
        self.fault.store(fault.map_or(0, DeviceFault::code), ORDER);
    }

    pub fn set_temperature(&self, share: f64) {
        self.temperature.store(share.to_bits(), ORDER);
    }

    pub fn set_speed_m_per_s(&self, speed: f64) {
        self.speed.store(speed.to_bits(), ORDER);
    }

    pub fn note_callback_s(&self, time_s: f64) {
        // The bits of positive numbers are in the order of the numbers.
        if time_s > 0.0 {
            self.worst_callback.fetch_max(time_s.to_bits(), ORDER);
        }
    }

    pub fn readings(&self) -> Readings {
        let number = |bits: &AtomicU64| f64::from_bits(bits.load(ORDER));
        Readings {
            calls: self.calls.load(ORDER),
            fault: self.fault(),
            error: self.error.load(ORDER),
            errors: self.errors.load(ORDER),
            temperature: number(&self.temperature),
            speed_m_per_s: number(&self.speed),
            worst_callback_s: number(&self.worst_callback),
        }
    }
}

const FAULTS: [DeviceFault; 9] = [
    DeviceFault::NotConnected,
    DeviceFault::TimedOut,
    DeviceFault::NonFiniteSample,
    DeviceFault::NonFiniteWrench,
    DeviceFault::InvalidPeriod,
    DeviceFault::NotCalibrated,
    DeviceFault::Overheated,
    DeviceFault::SafetyStop,
    DeviceFault::Driver,
];
