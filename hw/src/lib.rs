//! Haptic devices: the [`Device`] trait and its back ends.
//!
//! Encoder counts, driver units and calibration stand only here: everything that leaves this crate is in SI units and in
//! the world frame.

#![warn(missing_docs)]

pub mod backend;
pub mod conformance;
pub mod convert;
pub mod device;
pub mod libhd;
pub mod replay;
pub mod sim;

pub use backend::BackendKind;
pub use device::{Device, DeviceFault, DeviceInfo, HandGoal, Sample, Wrench};
pub use libhd::{Phantom, PhantomConfig};
pub use replay::ReplayDevice;
pub use sim::hand::{Effort, Hand};
pub use sim::link::{BadLink, LinkFaults};
pub use sim::path::{HandPath, ScriptedPath, Waypoint};
pub use sim::phantom::{SimulatedPhantom, SimulatedPhantomConfig};
