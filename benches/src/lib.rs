//! Fixtures of the measurements: bodies, insertions, converged twins, and the error of one run against another.

pub mod bodies;
pub mod error;
pub mod insertions;
pub mod live;
pub mod machine;
pub mod own;
pub mod session;
pub mod twin;
pub mod unfolded;
pub mod wall;
