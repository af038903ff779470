//! The host side of shared memory: the link to the core, the choice of core and scene, recordings, success of ticks.

#![warn(missing_docs)]

pub mod core_args;
#[cfg(not(target_family = "wasm"))]
pub mod health;
pub mod link;
pub mod moments;
#[cfg(not(target_family = "wasm"))]
pub mod record;
pub mod roster;
