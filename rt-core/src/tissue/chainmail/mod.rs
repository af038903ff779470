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
pub use solve::step;

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
        self.state.return_to_rest();
    }

    fn set_limits(&mut self, limits: Limits) {
        self.model.limits = limits;
    }

    fn memory_len(&self) -> usize {
        size_of::<f32>() * (3 * self.model.element_count() + 1)
    }

    fn save(&self, to: &mut [u8]) {
        if to.len() != self.memory_len() {
            return;
        }
        let mut rest = to;
        for component in &self.state.u {
            let bytes: &[u8] = bytemuck::cast_slice(component);
            let (here, after) = rest.split_at_mut(bytes.len());
            here.copy_from_slice(bytes);
            rest = after;
        }
        rest.copy_from_slice(&self.state.max_displacement.to_ne_bytes());
    }

    fn load(&mut self, from: &[u8]) {
        if from.len() != self.memory_len() {
            return;
        }
        let mut rest = from;
        for component in &mut self.state.u {
            let bytes: &mut [u8] = bytemuck::cast_slice_mut(component);
            let (here, after) = rest.split_at(bytes.len());
            bytes.copy_from_slice(here);
            rest = after;
        }
        self.state.max_displacement = bytemuck::pod_read_unaligned(rest);
    }
}
