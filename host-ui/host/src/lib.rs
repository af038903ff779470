//! The host side of shared memory: the link to the core, the choice of core and scene, recordings, success of ticks.

#![warn(missing_docs)]

pub mod core_args;
pub mod health;
pub mod link;
pub mod moments;
pub mod record;
pub mod roster;
