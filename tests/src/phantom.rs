//! A Phantom that is not there: the fake `libHD.so`, found and commanded.

use fake_hd::Control;
use libloading::os::unix::Library;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use stylet_hw::libhd::Placement;
use stylet_hw::{Device, DeviceFault, Phantom, PhantomConfig, Sample, Wrench};

/// The built library. Cargo puts it beside the tests, or one folder up when it was built by itself; the newer one counts.
pub fn library() -> PathBuf {
    let test = std::env::current_exe().expect("a test knows its own file");
    let deps = test.parent().expect("tests live in <target>/<profile>/deps");
    let folders = [Some(deps), deps.parent()];
    let found = folders.into_iter().flatten().map(|folder| folder.join("libfake_hd.so"));
    let age = |path: &PathBuf| path.metadata().and_then(|m| m.modified()).ok();
    found
        .filter(|path| path.exists())
        .max_by_key(age)
        .expect("libfake_hd.so is missing: run `cargo build --release --workspace` first")
}

/// The fake of this process: one at a time.
pub struct Fake {
    pub control: &'static Control,
    _alone: MutexGuard<'static, ()>,
}

impl Fake {
    /// Healthy, with nothing counted.
    pub fn new() -> Self {
        static ALONE: Mutex<()> = Mutex::new(());
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: our own library; it has no constructors.
        let library = unsafe { Library::new(library()) }.expect("the fake can be loaded");
        // SAFETY: the function has this type, and its block is never freed.
        let control = unsafe {
            let get = library
                .get::<extern "C" fn() -> *const Control>(b"fake_control")
                .expect("exported");
            &*get()
        };
        std::mem::forget(library);
        control.reset();
        Self { control, _alone: alone }
    }

    /// A Phantom over it whose servo thread needs no rights; what it reports is printed.
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

/// The fake at the world's origin.
pub fn config() -> PhantomConfig {
    PhantomConfig {
        library: Some(library()),
        name: None,
        placement: Placement::facing_patient(nalgebra::Vector3::zeros()),
        servo_hz: 1000,
    }
}

/// Drives `device` as the force loop does, every millisecond, until `ready`; false when it has not come true in time.
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
