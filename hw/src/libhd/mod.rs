//! Phantoms through OpenHaptics: `libHD.so`, loaded at run time, so that there is nothing to install without one.
//!
//! # Beside the servo loop, not in it
//!
//! The driver owns a servo thread and calls back once a tick. Stylet's force loop does not run in that callback but beside
//! it, and the two exchange poses and wrenches through triple buffers. The price is delay: a force that answers a pose
//! reaches the motors one servo period after that pose was read, instead of within the same tick, whatever the phase
//! between the two loops is, as long as the force loop's own work fits into what is left of the period. With `t_d` of
//! 1 ms instead of none the stiffness that stays passive, `K = b / (T/2 + t_d)`, falls to a third; a servo rate of 2 kHz
//! halves that delay, and the bound is then half. What it buys: the watchdog and the ramps go on when the driver stops
//! calling (a pulled cable is found by the loop that must react to it); one loop, one time grid and one record for every
//! device; no code of ours but [`servo`] in a thread that is not ours.
//!
//! The grids are not locked to each other: now and then a sample is seen twice or one is left out. A repeated sample
//! keeps its `sequence`, which is what the force loop counts as silence.
//!
//! # Threads
//!
//! *Servo*, the driver's, armed by us in its first callback ([`servo`]); *force loop*, in [`Device::read`] and
//! [`Device::write`](crate::Device::write); *keeper*, normal priority, the only one that makes calls that may block
//! (`keeper`): it connects, calibrates, and after a loss lets the device go and takes it up again, without ever closing
//! the library.
//!
//! [`Device::read`]: crate::Device::read

pub mod calibrate;
pub mod device;
pub mod diagnose;
pub mod errors;
pub mod exchange;
pub mod ffi;
pub mod frame;
mod keeper;
pub mod model;
pub mod servo;
pub mod session;

pub use device::{OpenError, Phantom, PhantomConfig};
pub use diagnose::{Finding, Severity, diagnose};
pub use exchange::Readings;
pub use ffi::Api;
pub use frame::Placement;
