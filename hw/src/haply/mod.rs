//! An Inverse3 of Haply through the maker's Inverse service 3.5: a websocket, JSON, one state for
//! each message.
//!
//! Tested only against a fake service, not on a device.
//!
//! An armed servo thread of ours, outside the force loop, sends the newest force and reads the
//! state that answers it; for the resulting delay see [`libhd`](crate::libhd). The exchange is in
//! lock-step: no force is sent while an answer is outstanding, so a slow service never queues
//! forces. Only a zero is sent out of turn, as soon as a fault appears. A connector of normal
//! priority opens the connection and reopens it after a loss.
//!
//! The websocket is neither encrypted nor signed, so the peer must be a program of this user or
//! root on this PC.
//!
//! The maker's pages say that a force is applied once and that the device returns to idle when
//! forces stop. They do not say after how long, or what a service does when its client dies.
//! Nothing here relies on it.
//!
//! The servo thread allocates, because the library does for each message; the force loop does not
//! wait for it.

mod connector;
mod device;
mod diagnose;
mod message;
mod model;
mod owner;
mod servo;
mod session;
mod socket;
mod stepped;
mod wire;

pub use device::{Haply, HaplyConfig, OpenError};
pub use diagnose::diagnose;
pub use session::{ConnectionError, Description, Wanted};
pub use socket::{BadAddress, Service};
pub use stepped::{Opener, Stepped};
pub use wire::{Wire, WireError};
