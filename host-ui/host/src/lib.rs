//! The host side of shared memory: the link to the core, the surfaces of its scenes, which core and scene a command asks for, recordings.

#![warn(missing_docs)]

pub mod bodies;
pub mod core_args;
pub mod field;
pub mod link;
pub mod mesh;
pub mod record;
