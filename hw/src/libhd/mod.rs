//! Phantoms through OpenHaptics: `libHD.so` is loaded at run time, so a machine without a Phantom needs no driver.
//!
//! # Beside the servo loop, not inside it
//!
//! The driver owns a servo thread and calls back once a tick. Stylet's force loop does not run in that callback but beside
//! it, and the two exchange poses and wrenches through triple buffers. The price is delay: a force that answers a pose
//! reaches the motors one servo period after that pose was read, instead of within the same tick, whatever the phase
//! between the two loops is, as long as the force loop's own work fits into what is left of the period. With `t_d` of
//! 1 ms instead of none the stiffness that stays passive, `K = b / (T/2 + t_d)`, falls to a third; a servo rate of 2 kHz
//! halves that delay, and the bound is then half. The gain: the watchdog and the ramps continue when the driver stops
//! calling (the loop that must react to a pulled cable also detects it); every device has the same loop, time grid and
//! record; only `servo` runs in a thread that is not ours.
//!
//! The grids are not locked to each other: occasionally a sample is seen twice or one is skipped. A repeated sample
//! keeps its `sequence`, which is what the force loop counts as silence.
//!
//! # Threads
//!
//! *Servo*, the driver's, armed by us in its first callback (`servo`); *force loop*, in [`Device::read`] and
//! [`Device::write`](crate::Device::write); *connector*, normal priority, the only one that makes calls that may
//! block (`connector`): it connects, calibrates, and after a loss releases and reconnects the device, without ever
//! closing the library.
//!
//! [`Device::read`]: crate::Device::read

mod calibrate;
mod connector;
mod device;
pub mod diagnose;
pub mod errors;
mod exchange;
pub mod ffi;
mod frame;
mod model;
mod servo;
mod session;

pub use device::{OpenError, Phantom, PhantomConfig};
pub use diagnose::diagnose;
pub use exchange::Readings;
pub use ffi::Api;
pub use session::{ConnectionError, Description};
