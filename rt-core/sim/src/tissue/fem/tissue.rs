//! FEM as a tissue model.

use super::compiled::{Compiled, prepare, step};
use super::material::{FemProblem, FemSettings, Integration, Material, Structure};
use super::model::FemModel;
use super::solve::SolveSettings;
use super::state::FemState;
use crate::scene::Scene;
use crate::tissue::{
    Carried, Deformed, ElementField, Held, HeldOutcome, LargeStrain, PackedField, Shift, Solve, StepReport, TissueModel,
};
use stylet_settings::ProblemList;

/// Springs of a body without layers: the modulus of 20 mm of fat over their thickness, as the second methods have it.
const SPRINGS_PA_PER_M: f64 = 5e3 / 20e-3;

/// Cycles in one tick. Two fit into 5 ms on the paper's gland only just; what is left is done in the ticks before,
/// ahead of the tip, and in those after.
pub const LIVE_CYCLES: u32 = 1;
/// Residual force, over the tip's, up to which an answer that is still being refined may be felt.
const FELT: f64 = 0.2;

/// Linear elasticity, quasi-static, on a scene's lattice.
#[derive(Clone)]
pub struct FemTissue<T = f32> {
    /// Topology, materials and multigrid.
    pub model: FemModel<T>,
    /// State of every element.
    pub state: FemState<T>,
    /// Tolerance and budget of a step.
    pub settings: SolveSettings,
    large: LargeStrain,
}

impl<T: Compiled> FemTissue<T> {
    /// Makes the scene's materials in its layers, solved as far as the loop has time for.
    pub fn new(scene: &Scene) -> Result<Self, ProblemList<FemProblem>> {
        let structures = scene.structures.iter().map(|s| match s.material.fixed {
            true => Structure::Fixed,
            false => Structure::Elastic(Material {
                youngs_modulus_pa: s.material.young_pa,
                poisson_ratio: s.material.poisson,
                integration: Integration::MeanDilatation,
            }),
        });
        let settings = FemSettings {
            structures: structures.collect(),
            structure_of: scene.lattice.structures().to_vec(),
            foundation_pa_per_m: SPRINGS_PA_PER_M,
            surroundings: scene.structures.iter().map(|s| s.material.surroundings).collect(),
        };
        let model = FemModel::in_layers(&scene.lattice, &scene.body, &settings, &scene.layers)?;
        Ok(FemTissue {
            state: FemState::at_rest(&model),
            large: LargeStrain::new(scene),
            model,
            settings: SolveSettings {
                relative_tolerance: 1e-3,
                max_cycles: LIVE_CYCLES,
            },
        })
    }
}

impl<T: Compiled> FemTissue<T> {
    /// Returns the report of a step that added answers up.
    fn displaced(&self, moved: u32) -> StepReport {
        StepReport {
            passes: 0,
            // What the columns were solved to is theirs; the sum adds nothing.
            residual: 0.0,
            moved,
            converged: self.state.max_displacement.is_finite(),
            max_displacement: self.state.max_displacement,
            held: HeldOutcome::None,
            solve: Solve::Nothing,
            tip_force_n: None,
        }
    }
}

impl<T: Compiled> TissueModel for FemTissue<T> {
    /// Solves the quasi-static problem: `dt_s` plays no part, and tissue that nothing holds is at rest at once.
    fn step(&mut self, held: Option<Held>, _dt_s: f64) -> StepReport {
        let report = step(&self.model, &mut self.state, held, &self.settings);
        StepReport {
            passes: report.cycles,
            residual: report.relative_residual,
            moved: report.moved,
            converged: report.converged,
            max_displacement: report.max_displacement,
            held: report.held,
            solve: if report.cycles > 0 {
                Solve::Cycles
            } else {
                Solve::Nothing
            },
            // The tissue pushes the tip with the opposite of what moves the patch.
            tip_force_n: Some(report.tip_force_n.map(|f| -f)),
        }
    }

    fn prepare(&mut self, next: Option<Held>) {
        prepare(&self.model, &mut self.state, next, &self.settings);
    }

    fn displace(&mut self, columns: &[PackedField], loads_n: &[f64], shift: Shift<'_>) -> Option<StepReport> {
        let moved = self.state.displace(&self.model, columns, loads_n, shift);
        Some(self.displaced(moved))
    }

    fn add(&mut self, fields: &[&ElementField]) -> Option<StepReport> {
        let moved = self.state.add(&self.model, fields);
        Some(self.displaced(moved))
    }

    fn unfold(&mut self, element: u32, least_corner: f64) -> bool {
        let u = &mut self.state.displacement;
        let linear = |e: u32| u.each_ref().map(|u| u.get(e as usize).copied().unwrap_or(0.0));
        let is_corrected = self
            .large
            .unfold(self.model.lattice(), [&linear, &|_| [0.0; 3]], element, least_corner);
        for (element, moved) in self.large.moved() {
            for (u, moved) in u.iter_mut().zip(moved) {
                if let Some(u) = u.get_mut(element as usize) {
                    *u += moved;
                }
            }
        }
        is_corrected
    }

    fn may_be_felt(&self, report: &StepReport) -> bool {
        report.residual <= FELT && report.max_displacement.is_finite()
    }

    fn deformed(&self) -> Deformed<'_> {
        Deformed {
            lattice: self.model.lattice(),
            u: [0, 1, 2].map(|axis| self.state.displacement(axis)),
            scale: 1.0,
            carried: Carried::Not,
            // Corners move with their neighbours; a cell is not stretched beyond what both move.
            reach: 1.0 + 3.0 * self.state.max_displacement,
        }
    }

    fn return_to_rest(&mut self) {
        self.state.forget();
        self.large.forget();
        step(&self.model, &mut self.state, None, &self.settings);
    }

    /// Returns the size of displacements, and of the offsets in the window near the tip: see
    /// [`is_all_saved`](TissueModel::is_all_saved).
    fn memory_len(&self) -> usize {
        self.state.memory_len() + self.large.memory_len()
    }

    /// Returns whether no patch is held or kept for when it is held again: its answers and the solver's are not saved.
    fn is_all_saved(&self) -> bool {
        self.state.has_forgotten()
    }

    fn save(&self, to: &mut [u8]) {
        if to.len() == self.memory_len() {
            let (state, large) = to.split_at_mut(self.state.memory_len());
            self.state.save(state);
            self.large.save(large);
        }
    }

    fn load(&mut self, from: &[u8]) {
        if from.len() == self.memory_len() {
            let (state, large) = from.split_at(self.state.memory_len());
            self.state.load(state);
            self.large.load(large);
        }
    }
}
