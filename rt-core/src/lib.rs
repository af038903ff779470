//! The real-time process: device, force loop, tissue.

pub mod active;
pub mod bridge;
pub mod cli;
pub mod core;
pub mod cost;
pub mod device;
pub mod force;
pub mod lab;
pub mod line;
pub mod needle;
pub mod rehearse;
pub mod replay;
pub mod rt;
pub mod scene;
pub mod tissue;
