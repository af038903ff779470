//! A faked Phantom: the library `libHD.so`, found and commanded.

use fake_hd::{Block, Control};
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use stylet_hw::{Axes, Device, DeviceFault, Phantom, PhantomConfig, Placement, Sample, Wrench};

/// Returns the built library.
pub fn library() -> PathBuf {
    fake_control::library("libfake_hd.so")
}

/// The fake of this process: one at a time.
pub struct Fake {
    pub control: &'static Control,
    _alone: MutexGuard<'static, ()>,
}

impl Fake {
    /// Makes it healthy, with all counters at zero.
    pub fn new() -> Self {
        static ALONE: Mutex<()> = Mutex::new(());
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let control: &Control = fake_control::block_of(&library());
        control.reset();
        Self { control, _alone: alone }
    }

    /// Opens a Phantom over it whose servo thread needs no rights; its reports are printed.
    pub fn open(&self) -> Phantom {
        let arm = Box::new(|| Ok("not armed".to_owned()));
        Phantom::open(config(), arm, Box::new(|text| println!("reported: {text}"))).expect("a healthy device")
    }
}

impl Default for Fake {
    fn default() -> Self {
        Self::new()
    }
}

/// Settings of the fake at the world's origin.
pub fn config() -> PhantomConfig {
    PhantomConfig {
        library: Some(library()),
        name: None,
        placement: Placement::facing_patient(Axes::OPEN_HAPTICS, nalgebra::Vector3::zeros()),
        servo_hz: 1000,
    }
}

/// Drives `device` every millisecond, as the force loop does, until `ready`; false if it has not come true in time.
pub fn drive(
    device: &mut Phantom,
    wrench: &Wrench,
    limit: Duration,
    mut ready: impl FnMut(&Result<Sample, DeviceFault>) -> bool,
) -> bool {
    let begun = std::time::Instant::now();
    while begun.elapsed() < limit {
        let sample = device.read(1e-3);
        let _ = device.write(wrench);
        if ready(&sample) {
            return true;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    false
}
