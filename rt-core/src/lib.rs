//! The real-time process: device, force loop, tissue.

pub mod force;
pub mod needle;
