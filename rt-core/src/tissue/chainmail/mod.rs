//! Restricted ChainMail: elements linked to six neighbours, each link with limits on stretch and shear.
//!
//! For a link along axis a, with d the difference of its ends in elements: `min <= d_a <= max`, and
//! `|d_b| <= d_a tan(theta)` for both other axes b (a frustum; theta is horizontal for links along x,
//! vertical for links along y and z). All limits together are a convex set, and the body at rest, moved
//! as a whole, is in it. Hence: recovery toward rest never breaks a limit, and there is always a way back
//! to a state without violations.

mod activity;
#[cfg(target_arch = "x86_64")]
mod avx2;
mod classes;
mod held;
mod kernels;
mod model;
mod project;
pub mod queue;
mod single;
mod solve;
mod spans;
mod state;
mod sweep;
#[cfg(test)]
mod tests;

pub(crate) use kernels::{Scaled, link_violation, ordered};
pub use model::ChainMail;
pub use single::single_pass;
pub use solve::step;
pub use state::TissueState;

use crate::scene::Scene;
use crate::tissue::{Deformed, Held, Limits, StepReport, TissueModel};

/// Restricted ChainMail as a tissue model.
#[derive(Clone)]
pub struct ChainMailTissue {
    pub model: ChainMail,
    pub state: TissueState,
}

impl ChainMailTissue {
    pub fn new(scene: &Scene, limits: Limits) -> Self {
        let model = ChainMail::new(scene, limits);
        let state = TissueState::at_rest(&model);
        ChainMailTissue { model, state }
    }
}

impl TissueModel for ChainMailTissue {
    fn step(&mut self, held: Option<Held>, dt_s: f64) -> StepReport {
        step(&self.model, &mut self.state, held, dt_s)
    }

    fn deformed(&self) -> Deformed<'_> {
        self.state.deformed(&self.model)
    }

    fn return_to_rest(&mut self) {
        self.state.return_to_rest(&self.model);
    }

    fn set_limits(&mut self, limits: Limits) {
        self.model.set_limits(limits);
        self.state.disturb(&self.model);
    }
}
