//! Trait of tissue models: a body that takes steps and can be read.

use super::{Carry, Deformed, ElementField, PackedField, Shift};
use crate::limits::Limits;

use serde::{Deserialize, Serialize};

/// Largest distance from rest to which a held element is followed, in elements; f32 resolves the tolerance up to here.
pub const REACH: f64 = 2048.0;

/// An element kept at a position of the scene frame during a step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Held {
    /// Number of the element.
    pub element: u32,
    /// Position where its centre is kept, in the scene frame, m.
    pub position_m: [f64; 3],
    /// Edge of the cube around the element at rest whose elements go along with it; 0 for the element alone.
    pub patch_m: f64,
}

/// Outcome for the held element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeldOutcome {
    /// None was given.
    None,
    /// Element that is where it was asked to be.
    Followed,
    /// Fixed tissue stopped it part of the way.
    Limited,
    /// Request that is not finite, out of reach, or for no element; the step only recovered.
    Refused,
}

/// Effort of the solver, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Solve {
    /// Nothing had to move.
    Nothing,
    /// Outward sweeps over what moves.
    Sweeps,
    /// Orthogonal projections over all links.
    Projections,
    /// Pulled toward the body at rest moved as a whole.
    Reanchored,
    /// Cycles of multigrid (FEM).
    Cycles,
}

/// Outcome of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Passes over the links (sweeps, projections, re-anchoring), or cycles of multigrid.
    pub passes: u32,
    /// ChainMail: largest violation over all links, in elements. FEM: residual force over the tip's force.
    pub residual: f64,
    /// Elements that the solver moved, besides recovery; the held one counts. ChainMail counts whole stretches of a
    /// run, from the first that moved to the last.
    pub moved: u32,
    /// Set where the residual is within the model's tolerance.
    pub converged: bool,
    /// Largest distance of an element from rest, in elements.
    pub max_displacement: f32,
    /// Outcome for the held element.
    pub held: HeldOutcome,
    /// Effort of the solver.
    pub solve: Solve,
    /// Force of the tissue on the tip, where the model knows forces.
    pub tip_force_n: Option<[f64; 3]>,
}

/// A body of tissue, as the loop and the laboratory use it.
///
/// Obligations: `step` does not allocate, lock or panic, whatever it is given; its work is bounded by a number
/// of passes; the same calls give the same bytes; a held element that is `Followed` is where it was asked to
/// be; positions stay finite. One suite holds every model to
/// them: `tests/physics/src/stability`.
pub trait TissueModel: Send {
    /// Advances by `dt_s` with `held` in place; a `dt_s` that is not above zero recovers nothing.
    fn step(&mut self, held: Option<Held>, dt_s: f64) -> StepReport;

    /// Called when a step's answer is out, with what will be held next if the needle keeps going: a model that has time
    /// left in this tick may work ahead, by a bounded piece. Obligations as for `step`. A wrong guess costs this work
    /// and no more; answers stay the same within the model's tolerance.
    fn prepare(&mut self, _next: Option<Held>) {}

    /// Sets the displacement to the sum of `columns` (m/N) times `loads_n` plus `shift`, instead of a step; releases
    /// the held element and clears its solver state. Obligations as for `step`. `None` from a model whose answers do
    /// not add up.
    fn displace(&mut self, _columns: &[PackedField], _loads_n: &[f64], _shift: Shift<'_>) -> Option<StepReport> {
        None
    }

    /// Adds these fields (m) to the displacement that [`displace`](Self::displace) has just set, and reports it again.
    /// Obligations as for `step`. `None` from a model whose answers do not add up.
    fn add(&mut self, _fields: &[&ElementField]) -> Option<StepReport> {
        None
    }

    /// Corrects inverted cells near the tip until the next step; returns whether it did. Called after a step, or after
    /// [`displace`](Self::displace) instead of one, with the smallest volume of a corner around the tip's element. The
    /// held element may be elsewhere until then. Obligations as for `step`.
    fn unfold(&mut self, _element: u32, _least_corner: f64) -> bool {
        false
    }

    /// Displaces the whole body, on top of what its steps do, until the next call. Nothing in a model that does not
    /// know such a displacement. Obligations as for `step`.
    fn carry(&mut self, _by: Carry<'_>) {}

    /// Returns whether forces may go by this step: a hand feels no step that has not converged, unless a model allows
    /// it.
    fn may_be_felt(&self, report: &StepReport) -> bool {
        report.converged
    }

    /// Returns the body after the last step.
    fn deformed(&self) -> Deformed<'_>;

    /// Returns every element to its place at rest, at once.
    fn return_to_rest(&mut self);

    /// Takes new limits, where the model has such; without allocating.
    fn set_limits(&mut self, _limits: Limits) {}

    /// Returns the size of all that one step leaves to the next, in bytes; constant for the life of the model. 0: it
    /// cannot be saved.
    fn memory_len(&self) -> usize {
        0
    }

    /// Returns whether those bytes are all of its state now: a model may hold more for a while than can be written in a
    /// tick. A recording begins at a step before which they are.
    fn is_all_saved(&self) -> bool {
        true
    }

    /// Writes those bytes, without allocating; nothing where `to` has another length.
    fn save(&self, _to: &mut [u8]) {}

    /// Loads what a model of the same body saved; nothing where `from` has another length.
    fn load(&mut self, _from: &[u8]) {}
}
