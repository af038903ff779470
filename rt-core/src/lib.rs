//! The command line of the real-time process.

#![warn(missing_docs)]

pub mod cli;
pub mod devices;
pub mod probe_task;
pub mod replay_file;
pub mod report;
