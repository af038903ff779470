//! The readers of files as they are, without the window.

#[path = "../../src/files/mod.rs"]
pub mod files;
#[path = "../../src/interrupt.rs"]
pub mod interrupt;
