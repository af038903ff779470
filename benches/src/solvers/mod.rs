//! The textbook's solver that the shipped one is compared with: one pass over the body, whatever it leaves violated.
//!
//! It is written as plainly as the textbook has it, in flat arrays, and knows nothing of what moved in the last step: a
//! reader can verify it at a glance, and a comparison with it is fair. It is for homogeneous bodies in one part. The
//! surroundings take nothing back: a displaced element stays until it is moved again.

mod body;
mod queue;

pub use body::Body;
pub use queue::PlainQueue;

#[cfg(test)]
mod tests;
