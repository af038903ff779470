//! Tissue: where each element of a scene is after each tick.
//!
//! One step is `step(&model, &mut state, held, dt_s)`. It does not allocate, lock or panic, and its work is
//! bounded by the number of elements times a stated number of passes, never by a clock: the same input
//! gives the same bytes.

pub mod chainmail;
mod check;
mod limits;
mod point;

pub use chainmail::{ChainMail, HeldOutcome, Solve, StepReport, TissueState, step};
pub use check::{largest_violation, write_surface};
pub use limits::{Limits, ParameterProblem, TissueParameters};
pub use point::MaterialPoint;

/// An element kept at a position of the scene frame during a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    pub element: u32,
    pub position_m: [f64; 3],
}
