//! The running core: two real-time loops, the control thread that owns every port, flight recordings and rehearsals.

#![warn(missing_docs)]

pub mod args;
mod background;
pub mod control;
pub mod device;
pub mod environment;
pub mod kept_probe;
pub mod lines;
mod pieces;
pub mod process;
pub mod rehearse;
pub mod replay;
pub mod rt;
pub mod signals;
pub mod stepped;
