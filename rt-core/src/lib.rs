//! The command line of the real-time process.

#![warn(missing_docs)]

pub mod cli;
pub mod replay_file;
pub mod report;
