//! The real-time process: scenes, tissue, force loop.

pub mod scene;
