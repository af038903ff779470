//! The ultrasound probe in the rectum: a rigid body that presses the wall, and through it the gland.
//!
//! *Before the probe moves*: [`ProbeQueue`] solves for the body's answer to a force on each [`Pad`] of the rectum's
//! wall, in slices. *At the rate of the tissue*: [`step`] finds the forces between probe and pads, none of which pulls,
//! and how the body is displaced by them. [`ProbeResponse::stiffness`] extrapolates the answer to the rate of the hand.
//!
//! The contact has no friction: the probe lies in gel. Measurements are in `docs/adr/0021-probe.md`.
//!
//! ```
//! use stylet_sim::probe::{ProbePose, ProbeShape};
//!
//! let probe = ProbeShape::default();
//! // The tip is 10 mm inside the body, the handle outside of it, towards -z.
//! let pose = ProbePose::new([0.0, 0.0, 10e-3], [0.0, 0.0, 1.0]).unwrap();
//! let (gap_m, outward) = probe.gap_m(&pose, [0.0, 15e-3, -20e-3]);
//! assert!((gap_m - (15e-3 - probe.radius_m)).abs() < 1e-12 && outward == [0.0, 1.0, 0.0]);
//! ```

// What the lists of clippy.toml name has no place in a tick; tests may.
#![cfg_attr(
    not(test),
    deny(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types)
)]

mod beside;
mod between;
mod body;
mod columns;
mod complementarity;
mod contact;
mod memory;
mod moves;
mod onto;
mod response;
mod shape;
mod wall;

pub use body::BodyProbe;
pub use columns::{BatchAnswers, BatchRoom, ProbeQueue, ReadyProbe, SolvedProbe};
pub use contact::{ContactReport, ProbeState, step};
pub use memory::ProbeMemory;
pub use response::{ProbeResponse, Wrench};
pub use shape::{ProbePose, ProbeShape};
pub use wall::{NoWall, PADS_APART_M, Pad, Point, Wall};

#[cfg(test)]
mod tests;
