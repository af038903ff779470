//! Haptic devices: the [`Device`] trait and its back ends.
//!
//! Encoder counts, driver units and calibration are confined to this crate: everything that leaves
//! it is in SI units and in the world frame.
//!
//! Without an operating system, in a browser, only the simulated hand and the replay are there.

#![warn(missing_docs)]

pub mod backend;
pub mod conformance;
pub mod convert;
#[cfg(not(target_family = "wasm"))]
pub mod drd;
#[cfg(not(target_family = "wasm"))]
mod driver_thread;
#[cfg(not(target_family = "wasm"))]
mod finding;
#[cfg(not(target_family = "wasm"))]
pub mod haply;
#[cfg(not(target_family = "wasm"))]
pub mod libhd;
#[cfg(not(target_family = "wasm"))]
mod library;
mod placement;
pub mod replay;
pub mod sim;
#[cfg(not(target_family = "wasm"))]
mod usb;

pub use backend::BackendKind;
#[cfg(not(target_family = "wasm"))]
pub use drd::{ForceDimension, ForceDimensionConfig};
#[cfg(not(target_family = "wasm"))]
pub use driver_thread::arm::{Arm, ArmError};
#[cfg(not(target_family = "wasm"))]
pub use driver_thread::keeper::Report;
#[cfg(not(target_family = "wasm"))]
pub use driver_thread::served::{Described, Served};
#[cfg(not(target_family = "wasm"))]
pub use finding::{Finding, Severity};
#[cfg(not(target_family = "wasm"))]
pub use haply::{Haply, HaplyConfig};
#[cfg(not(target_family = "wasm"))]
pub use libhd::{Phantom, PhantomConfig};
#[cfg(not(target_family = "wasm"))]
pub use library::{Driver, LoadError, LoadFailure, has_more_rights_than_user};
pub use placement::{Axes, Placement};
pub use replay::ReplayDevice;
pub use sim::hand::{Effort, Hand};
pub use sim::link::{BadLink, LinkFaults};
pub use sim::path::HandPath;
pub use sim::phantom::{SimulatedPhantom, SimulatedPhantomConfig};
pub use stylet_device::{self as device, Device, DeviceFault, DeviceInfo, HandGoal, Sample, Wrench};
