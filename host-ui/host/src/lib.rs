//! The host side of shared memory: the link to the core, which core and scene a command asks for, recordings.

#![warn(missing_docs)]

pub mod core_args;
pub mod link;
pub mod moments;
pub mod record;
pub mod roster;
