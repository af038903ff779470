//! The procedure: the hand's operations for one needle after another, and when each is done.
//!
//! Everything here is pure: no link, no device, no clock. The host drives [`Procedure`] over the link, the core drives
//! it over the two ticks of a rehearsal, and the window asks [`AtHand`] for the next operation of a hand without a
//! script. All three share the operations, their order, and the tolerances in [`tolerance`]. [`PlanFile`] is the file
//! from which window and studies take their needles.
//!
//! Lengths in m, speeds in m/s, times in s, scene frame.

#![warn(missing_docs)]

mod at_hand;
mod operation;
mod plan_file;
mod script;
pub mod tolerance;

pub use at_hand::AtHand;
pub use operation::{NeedleWay, Operation, Pace, Step};
pub use plan_file::{NeedleFile, PlanFile, PlanProblem, TemplateFile};
pub use script::{
    Done, HandRequest, Next, Observed, Patience, Procedure, Reply, StepFailure, Waiting, WaitsFor, needle_inside,
};
