//! One textbook pass for each step, as a tissue model.

use super::{Body, PlainQueue, PlainSweep};
use stylet_sim::limits::Limits;
use stylet_sim::scene::Scene;
use stylet_sim::tissue::{Deformed, Held, HeldOutcome, REACH, Solve, StepReport, TissueModel};

/// How the pass goes over the links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PassKind {
    /// First moved, first processed.
    Queue,
    /// The held line, then rows, then planes.
    Sweep,
}

enum Pass {
    Queue(PlainQueue),
    Sweep(PlainSweep),
}

/// One pass a step, whatever it leaves violated. Homogeneous bodies in one part only.
pub struct OnePass {
    body: Body,
    pass: Pass,
}

/// What a step holds, in elements.
struct Grip {
    element: u32,
    at: [f32; 3],
    /// Elements beside it along each axis that go along.
    beside: usize,
}

impl OnePass {
    /// The body of a scene at rest.
    ///
    /// # Panics
    ///
    /// If the scene has several structures.
    pub fn new(scene: &Scene, limits: &Limits, kind: PassKind) -> Self {
        OnePass {
            body: Body::at_rest(scene, limits),
            pass: match kind {
                PassKind::Queue => Pass::Queue(PlainQueue::new(&scene.lattice)),
                PassKind::Sweep => Pass::Sweep(PlainSweep::new(&scene.lattice)),
            },
        }
    }

    fn grip(&self, held: &Held) -> Option<Grip> {
        let lattice = &self.body.lattice;
        let (rest, h) = (lattice.rest_m(held.element), lattice.spacing_m);
        let at = [0, 1, 2].map(|a| (held.position_m[a] - rest[a]) / h);
        // Centres within half the edge; a hair more, as the quotient may be a whole number.
        let beside = 0.5 * held.patch_m / h + 1e-6;
        let known = (held.element as usize) < lattice.element_count();
        let within_reach = at.iter().all(|c| c.abs() <= REACH) && (0.0..=REACH).contains(&beside);
        (known && within_reach).then(|| Grip {
            element: held.element,
            at: at.map(|c| c as f32),
            beside: beside as usize,
        })
    }

    /// Puts the whole patch in place.
    fn put(&mut self, grip: &Grip) {
        let lattice = self.body.lattice.clone();
        let cell = lattice.cell(grip.element);
        let [x, y, z] = [0, 1, 2].map(|a| {
            let end = (cell[a] + grip.beside + 1).min(lattice.dims[a]);
            cell[a].saturating_sub(grip.beside)..end
        });
        for k in z {
            for j in y.clone() {
                for element in x.clone().filter_map(|i| lattice.element_of_cell(i, j, k)) {
                    self.body.put(element, grip.at);
                }
            }
        }
    }

    /// The patch is put in place before and after the pass, which knows one held element.
    fn pass(&mut self, grip: &Grip) -> u32 {
        self.put(grip);
        let moved = match &mut self.pass {
            Pass::Queue(queue) => queue.run(&mut self.body, grip.element, grip.at),
            Pass::Sweep(sweep) => {
                sweep.run(&mut self.body, grip.element, grip.at);
                self.body.lattice.element_count() as u32
            }
        };
        self.put(grip);
        moved
    }
}

impl TissueModel for OnePass {
    /// Never converged, as nobody verifies it: that would take longer than the pass.
    fn step(&mut self, held: Option<Held>, _dt_s: f64) -> StepReport {
        let grip = held.as_ref().and_then(|held| self.grip(held));
        let outcome = match (&held, &grip) {
            (None, _) => HeldOutcome::None,
            (Some(_), None) => HeldOutcome::Refused,
            (Some(_), Some(_)) => HeldOutcome::Followed,
        };
        let moved = grip.map_or(0, |grip| self.pass(&grip));
        StepReport {
            passes: u32::from(outcome == HeldOutcome::Followed),
            residual: f64::INFINITY,
            moved,
            converged: false,
            max_displacement: self.body.farthest,
            held: outcome,
            solve: Solve::Sweeps,
            tip_force_n: None,
        }
    }

    fn deformed(&self) -> Deformed<'_> {
        self.body.deformed()
    }

    fn return_to_rest(&mut self) {
        self.body.return_to_rest();
    }

    fn set_limits(&mut self, limits: Limits) {
        self.body.limits = *limits.links();
    }
}
