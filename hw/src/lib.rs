//! Haptic devices: the [`Device`] trait and its back ends.
//!
//! The only place where encoder counts, driver units and calibration live: everything that leaves this
//! crate is in SI units and in the world frame.

pub mod convert;
pub mod device;
pub mod libhd;
pub mod replay;
pub mod sim;

pub use device::{Device, DeviceFault, DeviceInfo, HandGoal, Sample, Wrench};
pub use libhd::{Phantom, PhantomConfig};
pub use replay::ReplayDevice;
pub use sim::hand::{Effort, Hand};
pub use sim::link::{BadLink, LinkFaults};
pub use sim::path::{HandPath, ScriptedPath, Waypoint};
pub use sim::phantom::{SimulatedPhantom, SimulatedPhantomConfig};
