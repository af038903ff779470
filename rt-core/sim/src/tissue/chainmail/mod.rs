//! Restricted ChainMail: elements linked to six neighbours, each link with limits on stretch and shear.
//!
//! For a link along axis a, with d the difference of its ends in elements: `min <= d_a <= max`, and
//! `|d_b| <= d_a tan(theta)` for both other axes b (a frustum; theta is horizontal for links along x,
//! vertical for links along y and z). All limits together are a convex set, and the body at rest, moved
//! as a whole, is in it. Hence: recovery toward rest never breaks a limit, and there is always a way back
//! to a state without violations.
//!
//! A step works on what moves: `activity` remembers which stretches those are, `sweep` follows them outward, `residual`
//! verifies what a pass leaves, `project` is for what sweeps do not solve, `follow` for what fixed tissue does not let
//! happen.

mod activity;
mod along_x;
mod classes;
mod follow;
mod held;
mod kernels;
mod memory;
mod model;
mod project;
mod propagate;
mod residual;
mod solve;
mod spans;
mod state;
mod stretch;
mod sweep;
#[cfg(test)]
mod tests;

pub use model::ChainMail;
pub use solve::step;
pub use state::TissueState;

use crate::limits::Limits;
use crate::scene::Scene;
use crate::tissue::{Carried, CarriedField, Carry, Deformed, Held, LargeStrain, StepReport, TissueModel};

/// Motion of a run without the carrying field below which it is not examined alone, in elements.
const SLIGHT: f32 = 0.05;

/// Restricted ChainMail as a tissue model.
#[derive(Clone)]
pub struct ChainMailTissue {
    /// Topology and limits.
    pub model: ChainMail,
    /// State of every element, in the carried body.
    pub state: TissueState,
    /// Field that carries the body by the loads of needles on lines; none in a scene without such needles.
    field: Option<CarriedField>,
    /// Correction that opens folded cells near the tip, on top of the last step.
    near_tip: Option<LargeStrain>,
}

impl ChainMailTissue {
    /// Number of elements at most of the body whose answer carries this one: of it no more is taken than how a line
    /// moves.
    pub(crate) const MOST_LINE_ELEMENTS: usize = 8_000;

    /// Returns the body of a scene at rest, which the loads of needles on lines carry.
    pub fn new(scene: &Scene, limits: Limits) -> Self {
        let coarse = scene.coarser_body(Self::MOST_LINE_ELEMENTS);
        ChainMailTissue {
            field: Some(CarriedField::new(scene, coarse)),
            near_tip: Some(LargeStrain::new(scene)),
            ..Self::as_printed(scene, limits)
        }
    }

    /// Returns the body of a scene at rest, without needles on lines: the paper as printed.
    pub fn as_printed(scene: &Scene, limits: Limits) -> Self {
        let model = ChainMail::new(scene, limits);
        ChainMailTissue {
            state: TissueState::at_rest(&model),
            model,
            field: None,
            near_tip: None,
        }
    }

    fn carried(&self) -> Carried<'_> {
        match (&self.field, &self.near_tip) {
            (Some(field), Some(near_tip)) if near_tip.is_shown() => Carried::Unfolded(field, near_tip),
            (Some(field), _) if !field.is_at_rest() => Carried::Field(field),
            _ => Carried::Not,
        }
    }

    /// Returns a bound of the distance of every element from rest, in elements: the farthest that one is carried, plus
    /// the farthest that one has moved.
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

    /// Returns a bound of the distance by which elements are carried, in elements.
    fn largest_carried(&self) -> f32 {
        let spacing_m = self.model.lattice.spacing_m;
        (self.carried().largest_m(spacing_m) / spacing_m) as f32
    }
}

impl TissueModel for ChainMailTissue {
    fn step(&mut self, held: Option<Held>, dt_s: f64) -> StepReport {
        // What holds the tip, and what follows from it, knows nothing of large strain.
        if let Some(near_tip) = &mut self.near_tip {
            near_tip.hide();
        }
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

    fn unfold(&mut self, element: u32, least_corner: f64) -> bool {
        let (Some(field), Some(near_tip)) = (&self.field, &mut self.near_tip) else {
            return false;
        };
        let body = self.state.deformed(&self.model);
        let lattice = body.lattice;
        let carried = |element| field.at_m(lattice, element).map(|m| (m / lattice.spacing_m) as f32);
        let besides = |element| body.not_carried(element).map(|u| u as f32);
        near_tip.unfold(lattice, [&carried, &besides], element, least_corner)
    }

    fn deformed(&self) -> Deformed<'_> {
        let body = self.state.deformed(&self.model);
        // A corner lies half an element from its element along each axis; a coarser body's elements have twice the edge
        // at least.
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
        if let Some(near_tip) = &mut self.near_tip {
            near_tip.forget();
        }
    }

    fn set_limits(&mut self, limits: Limits) {
        self.model.set_limits(limits);
        self.state.disturb(&self.model);
    }

    fn memory_len(&self) -> usize {
        let field = self.field.as_ref().map_or(0, CarriedField::memory_len);
        let near_tip = self.near_tip.as_ref().map_or(0, LargeStrain::memory_len);
        self.state.memory_len() + field + near_tip
    }

    fn save(&self, to: &mut [u8]) {
        if to.len() != self.memory_len() {
            return;
        }
        let (state, to) = to.split_at_mut(self.state.memory_len());
        self.state.save(state);
        if let (Some(field), Some(near_tip)) = (&self.field, &self.near_tip) {
            let (of_field, of_tip) = to.split_at_mut(field.memory_len());
            field.save(of_field);
            near_tip.save(of_tip);
        }
    }

    fn load(&mut self, from: &[u8]) {
        if from.len() != self.memory_len() {
            return;
        }
        let (state, from) = from.split_at(self.state.memory_len());
        self.state.load(&self.model, state);
        if let (Some(field), Some(near_tip)) = (&mut self.field, &mut self.near_tip) {
            let (of_field, of_tip) = from.split_at(field.memory_len());
            field.load(of_field);
            near_tip.load(of_tip);
        }
    }
}
