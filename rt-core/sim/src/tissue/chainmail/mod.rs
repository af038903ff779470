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
use crate::tissue::{BodyShift, Carried, CarriedField, Carry, Deformed, Held, StepReport, TissueModel};

/// Restricted ChainMail as a tissue model.
#[derive(Clone)]
pub struct ChainMailTissue {
    /// Topology and limits.
    pub model: ChainMail,
    /// Where every element is, in the body as it is carried.
    pub state: TissueState,
    /// How the body is carried as one piece.
    shift: BodyShift,
    /// How it is carried where something holds it; only in such a scene.
    field: Option<CarriedField>,
}

impl ChainMailTissue {
    /// The body of a scene at rest.
    pub fn new(scene: &Scene, limits: Limits) -> Self {
        let model = ChainMail::new(scene, limits);
        let state = TissueState::at_rest(&model);
        let coarse = scene.body_of_lines().filter(|_| scene.is_held());
        ChainMailTissue {
            model,
            state,
            shift: BodyShift::default(),
            field: coarse.map(|coarse| CarriedField::new(scene, coarse)),
        }
    }

    fn carried(&self) -> Carried<'_> {
        match &self.field {
            Some(field) if !field.is_at_rest() => Carried::Field(field),
            _ if self.shift != BodyShift::default() => Carried::Shift(&self.shift),
            _ => Carried::Not,
        }
    }

    /// No element is carried farther, in elements.
    fn largest_carried(&self) -> f32 {
        let lattice = &self.model.lattice;
        (self.carried().largest_m(lattice) / lattice.spacing_m) as f32
    }
}

impl TissueModel for ChainMailTissue {
    fn step(&mut self, held: Option<Held>, dt_s: f64) -> StepReport {
        let carried = self.carried();
        if matches!(carried, Carried::Not) {
            return step(&self.model, &mut self.state, held, dt_s);
        }
        // The held element has to go no farther than the rest of its way.
        let in_body = held.map(|held| {
            let carried_m = carried.at_m(&self.model.lattice, held.element);
            Held {
                position_m: [0, 1, 2].map(|a| held.position_m[a] - carried_m[a]),
                ..held
            }
        });
        let mut report = step(&self.model, &mut self.state, in_body, dt_s);
        let largest = self.largest_carried();
        report.max_displacement += largest;
        report.converged &= largest.is_finite();
        report
    }

    fn carry(&mut self, by: Carry<'_>) {
        self.shift = match by {
            Carry::Shift(shift) => shift,
            _ => BodyShift::default(),
        };
        match (&mut self.field, by) {
            (Some(field), Carry::Columns(columns, loads_n)) if loads_n.iter().any(|n| *n != 0.0) => {
                field.set(columns, loads_n);
            }
            (Some(field), Carry::Fields(columns, loads_n, fields)) => field.set_with(columns, loads_n, fields),
            (Some(field), _) if !field.is_at_rest() => field.clear(),
            _ => {}
        }
    }

    fn deformed(&self) -> Deformed<'_> {
        let body = self.state.deformed(&self.model);
        // A corner lies half an element from its element along each axis; a coarser body's elements have twice the edge at least.
        const CORNER: f32 = 2.5;
        Deformed {
            carried: self.carried(),
            reach: body.reach + CORNER * self.largest_carried(),
            ..body
        }
    }

    fn return_to_rest(&mut self) {
        self.state.return_to_rest(&self.model);
        self.carry(Carry::Not);
    }

    fn set_limits(&mut self, limits: Limits) {
        self.model.set_limits(limits);
        self.state.disturb(&self.model);
    }

    fn memory_len(&self) -> usize {
        let state = self.state.memory().iter().map(|part| part.len()).sum::<usize>();
        state + self.field.as_ref().map_or(0, CarriedField::memory_len) + size_of::<BodyShift>()
    }

    fn save(&self, to: &mut [u8]) {
        let Some((to, shift)) = to.split_last_chunk_mut::<{ size_of::<BodyShift>() }>() else {
            return;
        };
        shift.copy_from_slice(bytemuck::bytes_of(&self.shift));
        let field_len = self.field.as_ref().map_or(0, CarriedField::memory_len);
        let (state, field) = to.split_at_mut(to.len().saturating_sub(field_len));
        self.state.save(state);
        if let Some(carried) = &self.field {
            carried.save(field);
        }
    }

    fn load(&mut self, from: &[u8]) {
        let Some((from, shift)) = from.split_last_chunk::<{ size_of::<BodyShift>() }>() else {
            return;
        };
        let shift: BodyShift = bytemuck::pod_read_unaligned(shift);
        let is_motion = shift.shift_m.iter().chain(&shift.turn_rad).all(|c| c.is_finite());
        self.shift = if is_motion { shift } else { BodyShift::default() };
        let field_len = self.field.as_ref().map_or(0, CarriedField::memory_len);
        let (state, field) = from.split_at(from.len().saturating_sub(field_len));
        self.state.load(&self.model, state);
        if let Some(carried) = &mut self.field {
            carried.load(field);
        }
    }
}
