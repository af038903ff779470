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
use crate::tissue::{Carried, CarriedField, Carry, Deformed, Held, StepReport, TissueModel};

/// Runs that have moved by less besides what carries them are not looked at one by one, in elements.
const SLIGHT: f32 = 0.05;

/// Restricted ChainMail as a tissue model.
#[derive(Clone)]
pub struct ChainMailTissue {
    /// Topology and limits.
    pub model: ChainMail,
    /// Where every element is, in the body as it is carried.
    pub state: TissueState,
    /// How the body is carried by the loads of needles on lines; none in a scene whose needles have none.
    field: Option<CarriedField>,
}

impl ChainMailTissue {
    /// The body of a scene at rest.
    pub fn new(scene: &Scene, limits: Limits) -> Self {
        let model = ChainMail::new(scene, limits);
        let state = TissueState::at_rest(&model);
        ChainMailTissue {
            model,
            state,
            field: scene.body_of_lines().map(|coarse| CarriedField::new(scene, coarse)),
        }
    }

    fn carried(&self) -> Carried<'_> {
        match &self.field {
            Some(field) if !field.is_at_rest() => Carried::Field(field),
            _ => Carried::Not,
        }
    }

    /// No element is farther from rest, in elements: what is carried the farthest, or has moved besides.
    fn farthest(&self) -> f32 {
        let (carried, scale) = (self.largest_carried(), self.state.scale());
        if !carried.is_finite() {
            return carried;
        }
        let body = self.deformed();
        let mut farthest = carried + SLIGHT;
        for (run, square) in self.model.rows.runs.iter().zip(&self.state.run_square) {
            let most = scale * square.sqrt();
            if most <= SLIGHT || most + carried <= farthest {
                continue;
            }
            for element in run.first..run.end() {
                let moved = body.displacement(element).iter().map(|u| u * u).sum::<f64>().sqrt();
                // Never rounded down.
                farthest = farthest.max(moved as f32 * 1.000_001);
            }
        }
        farthest
    }

    /// No element is carried farther, in elements.
    fn largest_carried(&self) -> f32 {
        (self.carried().largest_m() / self.model.lattice.spacing_m) as f32
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
        report.max_displacement = self.farthest();
        report.converged &= report.max_displacement.is_finite();
        report
    }

    fn carry(&mut self, by: Carry<'_>) {
        if let Some(field) = &mut self.field {
            field.set(by);
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
        self.carry(Carry::NOT);
    }

    fn set_limits(&mut self, limits: Limits) {
        self.model.set_limits(limits);
        self.state.disturb(&self.model);
    }

    fn memory_len(&self) -> usize {
        let state = self.state.memory().iter().map(|part| part.len()).sum::<usize>();
        state + self.field.as_ref().map_or(0, CarriedField::memory_len)
    }

    fn save(&self, to: &mut [u8]) {
        let field_len = self.field.as_ref().map_or(0, CarriedField::memory_len);
        let (state, field) = to.split_at_mut(to.len().saturating_sub(field_len));
        self.state.save(state);
        if let Some(carried) = &self.field {
            carried.save(field);
        }
    }

    fn load(&mut self, from: &[u8]) {
        let field_len = self.field.as_ref().map_or(0, CarriedField::memory_len);
        let (state, field) = from.split_at(from.len().saturating_sub(field_len));
        self.state.load(&self.model, state);
        if let Some(carried) = &mut self.field {
            carried.load(field);
        }
    }
}
