//! Phantoms through OpenHaptics: `libHD.so` is loaded at run time, so a machine without a Phantom
//! needs no driver.
//!
//! # Outside the servo loop
//!
//! The driver owns a servo thread and calls back once a tick. Stylet's force loop runs outside that
//! callback; the two exchange poses and wrenches through triple buffers.
//!
//! The price is delay. A force that answers a pose reaches the motors one servo period after that
//! pose was read, instead of within the same tick. This holds for any phase between the two loops,
//! as long as the force loop's own work fits into the rest of the period. With `t_d` of 1 ms
//! instead of none the stiffness that stays passive, `K = b / (T/2 + t_d)`, falls to a third; a
//! servo rate of 2 kHz halves that delay, and the bound is then half.
//!
//! The gain is threefold. The watchdog and the ramps continue when the driver stops calling, so the
//! loop that must react to a pulled cable also detects it. Every device has the same loop, time
//! grid and record. Only `servo` runs in a thread that is not ours.
//!
//! The grids are not locked to each other: occasionally a sample is seen twice or one is skipped. A
//! repeated sample keeps its `sequence`, which the force loop counts as silence.
//!
//! # Threads
//!
//! The *servo* thread is the driver's, armed by us in its first callback (`servo`). The *force
//! loop* calls [`Device::read`] and [`Device::write`](crate::Device::write). The *connector*, of
//! normal priority, alone makes calls that may block (`connector`): it connects, calibrates, and
//! after a loss releases and reconnects the device. It never closes the library.
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
pub use ffi::Api;
pub use session::{ConnectionError, Description};
