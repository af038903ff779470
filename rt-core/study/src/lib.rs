//! Population studies: thousands of insertions by the two ticks of a run, divided into shards that know nothing of each
//! other.
//!
//! A study file gives scenes, plans and how hands and tissue vary. Each insertion draws its numbers from its own id, so
//! that the results do not depend on shards, threads or interruptions. Runs on threads of normal priority.

#![warn(missing_docs)]

pub mod args;
mod corners;
mod definition;
mod draw;
mod error;
mod insert;
mod parts;
mod plan;
mod problem;
mod progress;
mod quantity;
mod run;
mod spread;
mod structures;

pub use definition::{Gland, Study};
pub use error::StudyError;
pub use progress::Progress;
pub use run::{Ended, Order, run};

#[cfg(test)]
mod tests;
