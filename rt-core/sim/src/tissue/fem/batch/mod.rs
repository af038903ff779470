//! Eight loads on one body, solved side by side: the columns of a compliance.
//!
//! The solver next door takes one held patch, in rows of elements. Here nothing is held, the loads are many, and they
//! share one operator. So each node keeps its value for all loads next to each other, one SIMD lane each: an element's
//! stiffness is read once for eight answers, no row is padded to whole lanes, and only nodes in use take memory. The
//! mathematics is that of `multigrid` and `cg`: the levels come from the same `FemModel`, the cycle is the symmetric
//! one.
//!
//! [`advance`](BatchState::advance) does one pass over one level and returns, so that idle ticks can prepare columns in
//! slices.

mod condensed;
mod cycle;
mod held;
mod kernel;
mod level;
mod output;
mod parts;
mod solve;
mod support;

pub(super) use condensed::condensed;
pub(super) use held::{HeldForces, held_forces};
pub use level::{BatchModel, Part};
pub use solve::{BatchState, Progress};

use crate::simd::{Eight, LANES};

/// Number of loads that are solved at once.
pub const LOADS: usize = LANES;

/// Weight with which a load acts on a node, or with which the node is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeWeight {
    /// Number of the node.
    pub node: u32,
    /// Weight along x, y, z.
    pub weight: [f64; 3],
}

/// x, y, z of a node, each for every load.
type Node<T> = [Eight<T>; 3];

/// Maps the first half of a list here and the other one on a second thread, which has this one's priority.
fn on_two_threads<A: Sync, B: Send>(list: &[A], map: impl Fn(&[A]) -> Vec<B> + Sync) -> Vec<B> {
    let (first, second) = list.split_at(list.len().div_ceil(2));
    std::thread::scope(|scope| {
        let named = std::thread::Builder::new().name("layers".to_owned());
        let other = named.spawn_scoped(scope, || map(second));
        let mut mapped = map(first);
        match other.map(std::thread::ScopedJoinHandle::join) {
            Ok(Ok(others)) => mapped.extend(others),
            Ok(Err(panic)) => std::panic::resume_unwind(panic),
            Err(_) => mapped.extend(map(second)),
        }
        mapped
    })
}

#[cfg(test)]
mod tests;
