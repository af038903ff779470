//! The command line of the real-time process.

pub mod cli;
pub mod replay_file;
