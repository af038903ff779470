//! Devices of Force Dimension (omega, delta, sigma) and the Novint Falcon: `libdrd.so` or
//! `libdhd.so` is loaded at run time.
//!
//! Tested only against a fake library, not on a device.
//!
//! The SDK starts no thread. Its calls go to the device and back and may block. An armed
//! servo thread of ours makes them, outside the force loop; for the resulting delay see
//! [`libhd`](crate::libhd). A connector of normal priority opens the device and reopens it after a
//! loss. Only one of the two threads makes calls at any time.
//!
//! No thread can cancel a call that hangs. Therefore the device's own watchdog is armed: its
//! firmware drops a force that is not renewed. If the version or the device has none, the message
//! at the start says so.
//!
//! Regulation (`drd` functions) is not used: nothing here moves a device by itself, so the operator
//! calibrates it.

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
