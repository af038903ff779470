//! Eight loads on one body, solved side by side: the columns of a compliance.
//!
//! The solver next door takes one held patch, in rows of elements. Here nothing is held, the loads are many, and they share one
//! operator. So each node keeps its value for all loads next to each other, one SIMD lane each: an element's stiffness is read
//! once for eight answers, no row is padded to whole lanes, and only nodes in use take memory. The mathematics is that of
//! `multigrid` and `cg`: the levels come from the same `FemModel`, the cycle is the symmetric one.
//!
//! [`advance`](BatchState::advance) does one pass over one level and returns, so that idle ticks can prepare columns in slices.

mod cycle;
mod kernel;
mod level;
mod output;
mod solve;

pub use level::{BatchModel, NodeWeight};
pub use solve::{BatchState, Progress};

/// Loads that are solved at once.
pub const LOADS: usize = 8;

/// One value for each load.
type Lanes<T> = [T; LOADS];
/// x, y, z of a node, for each load.
type Node<T> = [Lanes<T>; 3];

#[cfg(test)]
mod tests;
