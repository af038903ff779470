//! Devices of Force Dimension (omega, delta, sigma) and the Novint Falcon: `libdrd.so` or `libdhd.so` is loaded at run time.
//!
//! Not tried on a device: only against a fake library of the tests.
//!
//! The SDK has no thread of its own. Its calls go to the device and back, so they may block: a servo thread makes them, armed by
//! us, beside the force loop; the delay that follows is that of [`libhd`](crate::libhd). A connector of normal priority opens the
//! device and takes it back after a loss. Only one of the two makes calls at any time.
//!
//! A call that hangs cannot be taken back by any thread. Therefore the device's own watchdog is armed: its firmware drops a
//! force that is not renewed. Where version or device has none, the message at the start says so.
//!
//! Regulation (`drd` functions) is not used: nothing here moves a device by itself, so calibration is left to the operator.

mod connector;
mod device;
mod diagnose;
pub mod errors;
pub mod ffi;
mod model;
mod servo;
mod session;
mod status;
mod stepped;

pub use device::{ForceDimension, ForceDimensionConfig, OpenError};
pub use diagnose::{device_count, diagnose, of_device};
pub use ffi::Api;
pub use session::{ConnectionError, Description};
pub use stepped::Stepped;
