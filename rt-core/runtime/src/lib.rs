//! The running core: two real-time loops, the control thread that owns every port, flight recordings and rehearsals.
//!
//! Without an operating system, in a browser, the loops are stepped on one thread ([`stepped_core`]): there is no
//! process, no armed thread, no bridge and no driver of a device.

#![warn(missing_docs)]

#[cfg(not(target_family = "wasm"))]
pub mod args;
mod background;
pub mod control;
#[cfg(not(target_family = "wasm"))]
pub mod device;
#[cfg(not(target_family = "wasm"))]
pub mod environment;
pub mod kept_probe;
pub mod lines;
mod pieces;
#[cfg(not(target_family = "wasm"))]
pub mod process;
pub mod rehearse;
pub mod replay;
pub mod rt;
#[cfg(not(target_family = "wasm"))]
pub mod signals;
pub mod start;
pub mod stepped;
pub mod stepped_core;
