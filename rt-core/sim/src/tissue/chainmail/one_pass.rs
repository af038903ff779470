//! The textbook's single pass as a tissue model, for comparison: fast, with limits left violated.

use super::held::{self, Grip};
use super::queue::QueuePass;
use super::solve::kept_fraction;
use super::{ChainMail, TissueState, single_pass};
use crate::limits::Limits;
use crate::scene::Scene;
use crate::tissue::{Deformed, Held, HeldOutcome, Solve, StepReport, TissueModel};

/// How the pass goes over the links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PassKind {
    /// First moved, first processed.
    Queue,
    /// The held line, then rows, then planes.
    Sweep,
}

/// One pass a step, whatever it leaves violated. Homogeneous bodies only.
pub struct OnePass {
    model: ChainMail,
    state: TissueState,
    queue: QueuePass,
    kind: PassKind,
}

impl OnePass {
    pub fn new(scene: &Scene, limits: Limits, kind: PassKind) -> Self {
        let model = ChainMail::new(scene, limits);
        OnePass {
            state: TissueState::at_rest(&model),
            queue: QueuePass::new(&model),
            model,
            kind,
        }
    }

    /// The patch is put in place before and after the pass, which knows one held element.
    fn pass(&mut self, held: Held, grip: &Grip) -> u32 {
        held::put(&self.model, &mut self.state, grip);
        let moved = match self.kind {
            PassKind::Queue => self.queue.run(&self.model, &mut self.state, held),
            PassKind::Sweep => {
                single_pass(&self.model, &mut self.state, held);
                self.model.element_count() as u32
            }
        };
        held::put(&self.model, &mut self.state, grip);
        moved
    }
}

impl TissueModel for OnePass {
    /// Never converged, as nobody looks: the check would take longer than the pass.
    fn step(&mut self, held: Option<Held>, dt_s: f64) -> StepReport {
        let (grip, outcome) = held::grip(&self.model, held);
        self.state.recover(&self.model, kept_fraction(&self.model, dt_s));
        let moved = match (held, grip) {
            (Some(held), Some(grip)) => self.pass(held, &grip),
            _ => 0,
        };
        StepReport {
            passes: u32::from(outcome == HeldOutcome::Followed),
            residual: f64::INFINITY,
            moved,
            converged: false,
            max_displacement: self.state.max_displacement,
            held: outcome,
            solve: Solve::Sweeps,
            tip_force_n: None,
        }
    }

    fn deformed(&self) -> Deformed<'_> {
        self.state.deformed(&self.model)
    }

    fn return_to_rest(&mut self) {
        self.state.return_to_rest(&self.model);
    }

    fn set_limits(&mut self, limits: Limits) {
        self.model.set_limits(limits);
    }
}
