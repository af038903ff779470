//! Inverse planning: needles, places of seeds and one strength from a catalogue, chosen so that the dose keeps its limits.
//!
//! The dose of a seed at each possible place is computed once at a few thousand points; a search then changes seeds, needles and the
//! strength. The full dose engine judges what it found; where the sample points were wrong about a limit, the search goes on with
//! that limit moved by the error.

pub mod annealing;
pub mod candidates;
mod figures;
mod greedy;
mod misplaced;
mod objective;
pub mod robust;
mod samples;
mod search;
mod state;

pub use figures::{Engine, Figures, Measure};
pub use robust::Statistic;
pub use search::Search;

use super::anatomy::Body;
use super::dose::criteria::DoseStructure;
use super::dose::perturb::{Errors, Perturbation};
use super::dose::{DoseKernel, Seed, Source};
use super::{Anatomy, Hole, ImplantPlan, PlanError, Template};
use std::ops::ControlFlow;

/// How the search goes on from the greedy choice of seeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Single seeds are exchanged as long as that helps.
    GreedyExchange,
    /// Simulated annealing, and an exchange at its end. It is the default for the reasons in ADR 13.
    #[default]
    Annealing,
}

/// What a plan aims at; limits of the dose are those of [`Figures::measures`].
#[derive(Clone, Debug, PartialEq)]
pub struct Objectives {
    /// Prescribed dose, Gy.
    pub prescription_gy: f64,
    /// Needles at most.
    pub needles: usize,
    /// Strengths that can be ordered, U, weakest first.
    pub strengths_u: Vec<f64>,
    /// How seeds miss their places.
    pub misplacement: Perturbation,
    /// Which D90 should then be 90 % of the prescription. Limits of the dose go first.
    pub robust: Statistic,
    /// What a needle costs beside [`Objectives::USUAL_NEEDLE`]: more of it gives a plan with fewer needles.
    pub needle_cost: f32,
    /// What lies in the tissue before the search begins.
    pub present: Present,
}

/// Seeds that lie in the tissue and holes that were used: a search adds to them and changes none of them. Where there are such seeds,
/// those at hand have one strength, and [`Objectives::strengths_u`] is that one alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Present {
    /// Seeds as they lie, scene frame. They no longer miss their places.
    pub seeds: Vec<Seed>,
    /// Holes that needles went through.
    pub holes: Vec<Hole>,
}

/// The mean distance of a seed from its place is about 5 mm in the clinic; 4 mm along each axis is the usual figure for studies.
const MISPLACEMENT: Perturbation = Perturbation {
    errors: Errors::of_sigma(4e-3),
    trials: 300,
    random_seed: 11,
};

impl Objectives {
    /// Cost of a needle where few of them are no aim.
    pub const USUAL_NEEDLE: f32 = 5e-4;

    /// The usual ones for a source.
    pub fn new(source: &Source, prescription_gy: f64) -> Self {
        Self {
            prescription_gy,
            needles: 25,
            strengths_u: catalogue_u(source, prescription_gy),
            misplacement: MISPLACEMENT,
            robust: Statistic::USUAL,
            needle_cost: Self::USUAL_NEEDLE,
            present: Present::default(),
        }
    }

    /// The usual ones where seeds lie in the tissue already; those to be added have this strength, U.
    pub fn beside(present: Present, strength_u: f64, source: &Source, prescription_gy: f64) -> Self {
        Self {
            strengths_u: vec![strength_u],
            present,
            ..Self::new(source, prescription_gy)
        }
    }
}

/// Strengths in which seeds are sold; for a source without a list, the same shares of the prescription at 1 cm as I-125 has.
fn catalogue_u(source: &Source, prescription_gy: f64) -> Vec<f64> {
    let steps = |from: f64, step: f64| (0..16).map(|n| from + f64::from(n) * step).collect();
    match source.nuclide.as_str() {
        "I-125" => steps(0.30, 0.02),
        "Pd-103" => steps(1.2, 0.1),
        _ => {
            let whole_u = prescription_gy / source.reference_dose_gy_per_u();
            steps(0.041 * whole_u, 0.0027 * whole_u)
        }
    }
}

/// A plan with its measures.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// The plan.
    pub plan: ImplantPlan,
    /// Measures by the full dose engine.
    pub figures: Figures,
    /// The same at the sample points of the search.
    pub sampled: Figures,
    /// Share of the trials with misplaced seeds whose D90 is at least 90 % of the prescription.
    pub robust: f64,
    /// Mean D90 of those trials, percent of the prescription.
    pub expected_d90: f64,
    /// D90 that nine of ten of those trials reach, percent of the prescription.
    pub d90_p10: f64,
    /// How far the D90 that was asked for is below 90 % of the prescription, as a share of that.
    pub shortfall: f64,
    /// What the search made small, at the sample points; below 1 where limits are kept.
    pub cost: f32,
    /// Holes before the target that bone closes.
    pub behind_bone: usize,
}

/// Target, urethra and rectum, by their names.
pub fn bodies(anatomy: &Anatomy) -> [Option<&Body>; 3] {
    let named = |which: DoseStructure| {
        let mut spared = anatomy.spared.iter();
        spared.find(|body| DoseStructure::of(&body.name, false) == Some(which))
    };
    [
        Some(&anatomy.target),
        named(DoseStructure::Urethra),
        named(DoseStructure::Rectum),
    ]
}

/// Searches for a plan; an error where no needle fits. `report` gets the share that is done; where it breaks, the search is cancelled.
pub fn plan(
    template: Template,
    anatomy: &Anatomy,
    kernel: &DoseKernel,
    source: &str,
    objectives: &Objectives,
    method: Method,
    report: impl Fn(f32) -> ControlFlow<()>,
) -> Result<Proposal, PlanError> {
    Search::new(template, anatomy, kernel, source, objectives, &report)?.find(objectives, method, &report)
}

impl Proposal {
    /// Limits first, then what is left of the coverage when seeds miss their places, then the hot part of the target.
    fn is_better_than(&self, other: &Self) -> bool {
        let order = |p: &Self| [p.figures.beyond(), p.shortfall, p.figures.v150];
        order(self) < order(other)
    }

    /// Whether it keeps all limits, and the coverage that was asked for when seeds miss their places.
    fn is_as_asked(&self) -> bool {
        self.figures.beyond() == 0.0 && self.shortfall == 0.0
    }
}

#[cfg(test)]
mod glands;
#[cfg(test)]
mod tests;
