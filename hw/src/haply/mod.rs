//! An Inverse3 of Haply through the maker's Inverse service 3.5: a websocket, JSON, one state for each message.
//!
//! Not tried on a device: only against a fake service of the tests.
//!
//! A servo thread beside the force loop, armed by us, sends the newest force and reads the state that answers it; the delay
//! that follows is that of [`libhd`](crate::libhd). The exchange is in lock-step: no force is sent while an answer is owed,
//! so that a service that falls behind never has a queue of forces. Only a zero is sent out of turn, as soon as anything is
//! wrong. A connector of normal priority opens the connection and opens it again after a loss.
//!
//! The websocket is neither encrypted nor signed: what answers has to be a program of this user or root on this PC.
//!
//! The maker's pages say that a force is applied once and that the device returns to idle when forces stop; they do not say
//! after how long, nor what a service does whose client dies. Nothing here relies on it.
//!
//! The servo thread allocates, as the library does for each message; the force loop does not wait for it.

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
