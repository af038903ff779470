//! Restricted ChainMail: elements linked to six neighbours, each link with limits on stretch and shear.
//!
//! For a link along axis a, with d the difference of its ends in elements: `min <= d_a <= max`, and
//! `|d_b| <= d_a tan(theta)` for both other axes b (a frustum; theta is horizontal for links along x,
//! vertical for links along y and z). All limits together are a convex set, and the body at rest, moved
//! as a whole, is in it. Hence: recovery toward rest never breaks a limit, and there is always a way back
//! to a state without violations.
//!
//! A step works on what moves: `activity` remembers which stretches those are, `sweep` follows them outward,
//! `residual` verifies what a pass leaves, `project` is for what sweeps do not solve, `follow` for what fixed tissue does
//! not let happen, `relax` makes the body elastic where that is asked for.

mod activity;
mod along_x;
#[cfg(target_arch = "x86_64")]
mod avx2;
mod classes;
mod follow;
mod held;
mod kernels;
mod loops;
mod memory;
mod model;
mod project;
mod propagate;
mod relax;
mod residual;
mod segments;
mod solve;
mod spans;
mod springs;
mod state;
mod sweep;
#[cfg(test)]
mod tests;

pub(crate) use kernels::{Scaled, link_violation, ordered};
pub use model::ChainMail;
pub use solve::step;
pub use state::TissueState;

use crate::limits::Limits;
use crate::scene::Scene;
use crate::tissue::{Deformed, Held, StepReport, TissueModel};

/// Restricted ChainMail as a tissue model.
#[derive(Clone)]
pub struct ChainMailTissue {
    /// Topology and limits.
    pub model: ChainMail,
    /// Where every element is.
    pub state: TissueState,
}

impl ChainMailTissue {
    /// The body of a scene at rest.
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

    fn memory_len(&self) -> usize {
        self.state.memory().iter().map(|part| part.len()).sum()
    }

    fn save(&self, to: &mut [u8]) {
        self.state.save(to);
    }

    fn load(&mut self, from: &[u8]) {
        self.state.load(&self.model, from);
    }
}
