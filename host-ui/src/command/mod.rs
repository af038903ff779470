//! Commands that open no window.

/// Error of a command, of any type, printed on the terminal.
pub type CommandError = Box<dyn std::error::Error>;

pub mod picture;
