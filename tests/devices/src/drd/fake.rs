//! The fake Force Dimension library, found and commanded.

use fake_drd::{Block, Control};
use nalgebra::Vector3;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use stylet_hw::drd::{Api, ForceDimension, ForceDimensionConfig};
use stylet_hw::{Axes, Placement};

/// Returns the built library.
pub fn library() -> PathBuf {
    fake_control::library("libfake_drd.so")
}

/// Returns a copy of the library in which each of these functions has another name, as in another
/// version.
pub fn library_without(functions: &[&str], folder: &Path) -> PathBuf {
    let mut bytes = std::fs::read(library()).expect("the fake can be read");
    for function in functions {
        let name = [b"\0", function.as_bytes(), b"\0"].concat();
        let found: Vec<usize> = (0..bytes.len() - name.len())
            .filter(|&at| bytes[at..].starts_with(&name))
            .collect();
        assert!(!found.is_empty(), "{function} is not exported");
        for at in found {
            bytes[at + 1] = b'x';
        }
    }
    let path = folder.join("libfake_drd_of_another_version.so");
    std::fs::write(&path, bytes).expect("the copy can be written");
    path
}

/// Fake of this process: one at a time.
pub struct Fake {
    pub control: &'static Control,
    _alone: MutexGuard<'static, ()>,
}

impl Fake {
    /// Creates a healthy fake with all counters at zero.
    pub fn new() -> Self {
        static ALONE: Mutex<()> = Mutex::new(());
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let control: &Control = fake_control::block_of(&library());
        control.reset();
        // A test that failed may have left it open.
        // SAFETY: the number of the fake's only device.
        unsafe { (api().dhdClose)(0) };
        control.reset();
        Self { control, _alone: alone }
    }

    /// Opens a device with threads; its reports are printed.
    pub fn open(&self) -> ForceDimension {
        let arm = Box::new(|| Ok("not armed".to_owned()));
        ForceDimension::open(config(), arm, Box::new(|text| println!("reported: {text}"))).expect("a healthy device")
    }
}

pub fn api() -> Api {
    Api::load(Some(&library())).expect("the fake has every function")
}

/// Returns the settings of the fake at the world's origin.
pub fn config() -> ForceDimensionConfig {
    ForceDimensionConfig {
        library: Some(library()),
        number: 0,
        placement: Placement::facing_patient(Axes::FORCE_DIMENSION, Vector3::zeros()),
        servo_hz: 1000,
    }
}
