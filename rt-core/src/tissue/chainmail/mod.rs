//! Restricted ChainMail: elements linked to six neighbours, each link with limits on stretch and shear.
//!
//! For a link along axis a, with d the difference of its ends in elements: `min <= d_a <= max`, and
//! `|d_b| <= d_a tan(theta)` for both other axes b (a frustum; theta is horizontal for links along x,
//! vertical for links along y and z). All limits together are a convex set, and the body at rest, moved
//! as a whole, is in it. Hence: recovery toward rest never breaks a limit, and there is always a way back
//! to a state without violations.

mod kernels;
mod model;
mod project;
pub mod queue;
mod solve;
mod spans;
mod sweep;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod times;

pub(crate) use kernels::violation;
pub use model::{ChainMail, TissueState};
pub use solve::{HeldOutcome, Solve, StepReport, step};
