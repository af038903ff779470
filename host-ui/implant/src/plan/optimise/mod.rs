//! Inverse planning: needles, places of seeds and one strength from a catalogue, chosen so that the
//! dose meets its limits.
//!
//! The dose of a seed at each possible place is computed once at a few thousand points; a search
//! then changes seeds, needles and the strength. The full dose engine judges the result; if the
//! sample points were wrong about a limit, the search continues with that limit shifted by the
//! error.

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
use super::dose::{Seed, Source};
use super::{Anatomy, Hole, ImplantPlan};

/// Objectives of a plan; limits of the dose are those of [`Figures::measures`].
#[derive(Clone, Debug, PartialEq)]
pub struct Objectives {
    /// Prescribed dose, Gy.
    pub prescription_gy: f64,
    /// Largest number of needles.
    pub needles: usize,
    /// Strengths that can be ordered, U, weakest first.
    pub strengths_u: Vec<f64>,
    /// Random misplacement of seeds.
    pub misplacement: Perturbation,
    /// D90 that must then be 90 % of the prescription. Limits of the dose take precedence.
    pub robust: Statistic,
    /// Cost of a needle in addition to [`Objectives::USUAL_NEEDLE`]: a higher one gives a plan with
    /// fewer needles.
    pub needle_cost: f32,
    /// Seeds and used holes before the search begins.
    pub present: Present,
}

/// Seeds in the tissue and used holes, which a search keeps unchanged. With such seeds, those
/// available have one strength, the only one in [`Objectives::strengths_u`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Present {
    /// Seeds at their actual places, scene frame. They are no longer misplaced at random.
    pub seeds: Vec<Seed>,
    /// Holes that needles went through.
    pub holes: Vec<Hole>,
}

/// Usual misplacement. The mean distance of a seed from its place is about 5 mm in the clinic; 4 mm
/// along each axis is the usual figure for studies.
const MISPLACEMENT: Perturbation = Perturbation {
    errors: Errors::of_sigma(4e-3),
    trials: 300,
    random_seed: 11,
};

impl Objectives {
    /// Cost of a needle if a small number is not an aim.
    pub const USUAL_NEEDLE: f32 = 5e-4;

    /// Returns the usual objectives for a source.
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
}

/// Returns the strengths on sale; for a source without a list, the same shares of the prescription
/// at 1 cm as for I-125.
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

/// Plan with its measures.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// The plan.
    pub plan: ImplantPlan,
    /// Measures by the full dose engine.
    pub figures: Figures,
    /// Measures at the sample points of the search.
    pub sampled: Figures,
    /// Share of the trials with misplaced seeds whose D90 is at least 90 % of the prescription.
    pub robust: f64,
    /// Mean D90 of those trials, percent of the prescription.
    pub expected_d90: f64,
    /// D90 that nine of ten of those trials reach, percent of the prescription.
    pub d90_p10: f64,
    /// Distance of the requested D90 below 90 % of the prescription, as a share of that.
    pub shortfall: f64,
}

/// Returns target, urethra and rectum, by their names.
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

impl Proposal {
    /// Compares limits first, then the robustness of the coverage, then the hot part of the target.
    fn is_better_than(&self, other: &Self) -> bool {
        let order = |p: &Self| [p.figures.beyond(), p.shortfall, p.figures.v150];
        order(self) < order(other)
    }

    /// Returns whether it meets all limits, and the requested robustness of the coverage.
    fn is_as_asked(&self) -> bool {
        self.figures.beyond() == 0.0 && self.shortfall == 0.0
    }
}

#[cfg(test)]
pub(crate) mod tests;
