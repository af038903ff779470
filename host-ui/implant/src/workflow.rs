//! The plan of one needle, and the procedure driven over the link.

mod plan;
mod run;

pub use plan::{default_plan, move_request, plan_with_seeds};
pub use run::{NeedleTask, Placed, Run, RunError, RunFailure, RunStatus};
pub use stylet_procedure::{Pace, Patience, Step, Waiting};
