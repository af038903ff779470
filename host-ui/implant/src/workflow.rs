//! The four steps of an implantation: plan, place the needle, insert, drop seeds while retracting.

mod plan;
mod run;

pub use plan::{NeedlePlan, Pace, default_plan, move_request, patient_axis, plan_request, plan_with_seeds};
pub use run::{NeedleTask, Run, RunStatus, Step};
