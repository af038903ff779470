//! A device with threads, driven as by the force loop.

use std::time::{Duration, Instant};
use stylet_hw::{Device, DeviceFault, Sample, Wrench};

pub const LONG: Duration = Duration::from_secs(10);

/// Waits for `ready`; returns false if it does not come true in time.
pub fn until(limit: Duration, mut ready: impl FnMut() -> bool) -> bool {
    let begun = Instant::now();
    while begun.elapsed() < limit {
        if ready() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    false
}

/// Drives `device` every millisecond until `ready`; returns false if it does not come true in time.
pub fn drive(
    device: &mut impl Device,
    wrench: &Wrench,
    mut ready: impl FnMut(&Result<Sample, DeviceFault>) -> bool,
) -> bool {
    until(LONG, || {
        let sample = device.read(1e-3);
        let _ = device.write(wrench);
        ready(&sample)
    })
}
