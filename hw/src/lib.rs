//! Haptic devices: the [`Device`] trait and its back ends.
//!
//! Encoder counts, driver units and calibration are confined to this crate: everything that leaves
//! it is in SI units and in the world frame.

#![warn(missing_docs)]

pub mod backend;
pub mod conformance;
pub mod convert;
pub mod drd;
mod driver_thread;
mod finding;
pub mod haply;
pub mod libhd;
mod library;
mod placement;
pub mod replay;
pub mod sim;
mod usb;

pub use backend::BackendKind;
pub use drd::{ForceDimension, ForceDimensionConfig};
pub use driver_thread::arm::{Arm, ArmError};
pub use driver_thread::keeper::Report;
pub use driver_thread::served::{Described, Served};
pub use finding::{Finding, Severity};
pub use haply::{Haply, HaplyConfig};
pub use libhd::{Phantom, PhantomConfig};
pub use library::{Driver, LoadError, LoadFailure, has_more_rights_than_user};
pub use placement::{Axes, Placement};
pub use replay::ReplayDevice;
pub use sim::hand::{Effort, Hand};
pub use sim::link::{BadLink, LinkFaults};
pub use sim::path::HandPath;
pub use sim::phantom::{SimulatedPhantom, SimulatedPhantomConfig};
pub use stylet_device::{self as device, Device, DeviceFault, DeviceInfo, HandGoal, Sample, Wrench};
