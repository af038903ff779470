//! Textbook solvers that the shipped one is compared with: one pass over the body, whatever it leaves violated.
//!
//! They are written as plainly as the textbook has them, in flat arrays, and know nothing of what moved in the last
//! step: a reader can verify them at a glance, and a comparison with them is fair. They are for homogeneous bodies in one
//! part. The surroundings take nothing back: a displaced element stays until it is moved again.

mod body;
mod one_pass;
mod queue;
mod sweep;

pub use body::Body;
pub use one_pass::{OnePass, PassKind};
pub use queue::PlainQueue;
pub use sweep::PlainSweep;

#[cfg(test)]
mod tests;
