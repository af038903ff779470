//! The real-time process: scenes, tissue, force loop.

pub mod scene;
pub mod tissue;
