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
use crate::tissue::{BodyShift, Deformed, Held, StepReport, TissueModel};

/// Restricted ChainMail as a tissue model.
#[derive(Clone)]
pub struct ChainMailTissue {
    /// Topology and limits.
    pub model: ChainMail,
    /// Where every element is, in the body as a whole.
    pub state: TissueState,
    /// How that is moved.
    shift: Option<BodyShift>,
}

impl ChainMailTissue {
    /// The body of a scene at rest.
    pub fn new(scene: &Scene, limits: Limits) -> Self {
        let model = ChainMail::new(scene, limits);
        let state = TissueState::at_rest(&model);
        ChainMailTissue {
            model,
            state,
            shift: None,
        }
    }
}

impl ChainMailTissue {
    /// No element is moved farther by the body as a whole, in elements.
    fn largest_shift(&self) -> f32 {
        let lattice = &self.model.lattice;
        let largest_m = self.shift.map_or(0.0, |shift| shift.largest_m(lattice));
        (largest_m / lattice.spacing_m) as f32
    }
}

impl TissueModel for ChainMailTissue {
    fn step(&mut self, held: Option<Held>, dt_s: f64) -> StepReport {
        let Some(shift) = self.shift else {
            return step(&self.model, &mut self.state, held, dt_s);
        };
        // In the body as a whole the held element has to go the rest of the way.
        let in_body = held.map(|held| {
            let whole_m = shift.at_m(self.model.lattice.rest_m(held.element));
            Held {
                position_m: [0, 1, 2].map(|a| held.position_m[a] - whole_m[a]),
                ..held
            }
        });
        let mut report = step(&self.model, &mut self.state, in_body, dt_s);
        report.max_displacement += self.largest_shift();
        report
    }

    fn carry(&mut self, shift: Option<BodyShift>) {
        self.shift = shift.filter(|shift| *shift != BodyShift::default());
    }

    fn deformed(&self) -> Deformed<'_> {
        let body = self.state.deformed(&self.model);
        Deformed {
            shift: self.shift,
            reach: body.reach + self.largest_shift(),
            ..body
        }
    }

    fn return_to_rest(&mut self) {
        self.state.return_to_rest(&self.model);
        self.shift = None;
    }

    fn set_limits(&mut self, limits: Limits) {
        self.model.set_limits(limits);
        self.state.disturb(&self.model);
    }

    fn memory_len(&self) -> usize {
        let state = self.state.memory().iter().map(|part| part.len()).sum::<usize>();
        state + size_of::<BodyShift>()
    }

    fn save(&self, to: &mut [u8]) {
        if let Some((state, shift)) = to.split_last_chunk_mut() {
            self.state.save(state);
            let bytes: &mut [u8; size_of::<BodyShift>()] = shift;
            bytes.copy_from_slice(bytemuck::bytes_of(&self.shift.unwrap_or_default()));
        }
    }

    fn load(&mut self, from: &[u8]) {
        const BYTES: usize = size_of::<BodyShift>();
        if let Some((state, shift)) = from.split_last_chunk::<BYTES>() {
            self.state.load(&self.model, state);
            let shift: BodyShift = bytemuck::pod_read_unaligned(shift);
            let numbers = shift.shift_m.iter().chain(&shift.turn_rad);
            let is_motion = numbers.clone().all(|c| c.is_finite()) && numbers.into_iter().any(|c| *c != 0.0);
            self.shift = is_motion.then_some(shift);
        }
    }
}
