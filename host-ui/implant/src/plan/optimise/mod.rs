//! Inverse planning: needles, places of seeds and one strength from a catalogue, chosen so that the dose keeps its limits.
//!
//! The dose of a seed at each possible place is computed once at a few thousand points; a search then changes seeds, needles and the
//! strength. The full dose engine judges what it found; where the sample points were wrong about a limit, the search goes on with
//! that limit moved by the error.

pub mod annealing;
pub mod candidates;
mod figures;
mod greedy;
mod objective;
pub mod robust;
mod samples;
mod state;

pub use figures::{Engine, Figures, Measure};

use super::anatomy::Body;
use super::dose::criteria::DoseStructure;
use super::dose::perturb::{Errors, Perturbation};
use super::dose::{DoseKernel, Source};
use super::{Anatomy, ImplantPlan, PlanError, Template};
use annealing::Schedule;
use candidates::Candidates;
use objective::Limits;
use robust::{TRIALS_KEPT, Trials};
use samples::Samples;
use state::State;
use std::ops::ControlFlow;

/// How the search goes on from the greedy choice of seeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Single seeds are exchanged as long as that helps. It is the default for the reasons in ADR 13.
    #[default]
    GreedyExchange,
    /// Simulated annealing, and an exchange at its end.
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
    /// How seeds miss their places: 95 % of the trials should keep a D90 of 90 % of the prescription. Limits of the dose go first.
    pub misplacement: Perturbation,
}

/// The mean distance of a seed from its place is about 5 mm in the clinic; 4 mm along each axis is the usual figure for studies.
const MISPLACEMENT: Perturbation = Perturbation {
    errors: Errors::of_sigma(4e-3),
    trials: 150,
    random_seed: 11,
};

impl Objectives {
    /// The usual ones for a source.
    pub fn new(source: &Source, prescription_gy: f64) -> Self {
        Self {
            prescription_gy,
            needles: 25,
            strengths_u: catalogue_u(source, prescription_gy),
            misplacement: MISPLACEMENT,
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
    /// What the search made small, at the sample points; below 1 where limits are kept.
    pub cost: f32,
    /// Holes before the target that bone closes.
    pub behind_bone: usize,
}

/// Places in the catalogue that a search may begin with, 0.44 and 0.52 U for I-125; the one whose greedy choice costs least is taken.
const FIRST_STRENGTHS: [usize; 2] = [7, 11];
/// The search, and corrections of it by what the full engine found.
const ROUNDS: usize = 3;
const FIRST_SEARCH: Schedule = Schedule {
    moves: 60_000,
    temperatures: [0.006, 0.0003],
};
const CORRECTION: Schedule = Schedule {
    moves: 20_000,
    temperatures: [0.002, 0.0003],
};
/// Share of all that is reported after the search begins and after its first round.
const BEGUN: f32 = 0.1;
const SEARCHED: f32 = 0.7;
/// Share of annealing in a round.
const ANNEALED: f32 = 0.7;
/// The reserve above the prescription that a search begins with, and the largest.
const FIRST_LEVEL: f32 = 1.1;
const HIGHEST_LEVEL: f32 = 1.2;
/// Rounds over all seeds after which an exchange ends, whatever it still finds.
const MOST_EXCHANGES: usize = 12;

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
    let cancelled = |flow: ControlFlow<()>| match flow {
        ControlFlow::Break(()) => Err(PlanError::Cancelled),
        ControlFlow::Continue(()) => Ok(()),
    };
    cancelled(report(0.0))?;
    let candidates = Candidates::new(&template, anatomy);
    if candidates.ways.is_empty() || objectives.strengths_u.is_empty() {
        return Err(PlanError::NoWay);
    }
    let bodies = bodies(anatomy);
    let samples = Samples::new(bodies, &candidates, kernel, objectives.prescription_gy);
    cancelled(report(BEGUN / 2.0))?;
    let engine = Engine::new(kernel, bodies);
    let strengths_u = &objectives.strengths_u;
    let mut level = FIRST_LEVEL;
    let limits = limits(objectives, level, None);
    let mut begun: Option<State> = None;
    for strength in FIRST_STRENGTHS.into_iter().filter(|s| *s < strengths_u.len()) {
        let mut state = State::empty(&candidates, &samples, strengths_u, strength, limits);
        cancelled(greedy::build(&mut state, &|_| report(BEGUN)))?;
        if begun.as_ref().is_none_or(|begun| state.cost < begun.cost) {
            begun = Some(state);
        }
    }
    let mut state = begun.ok_or(PlanError::NoWay)?;
    let mut best: Option<Proposal> = None;
    for round in 0..ROUNDS {
        let span = match round {
            0 => [BEGUN, SEARCHED],
            n => [n - 1, n].map(|n| SEARCHED + (1.0 - SEARCHED) * n as f32 / (ROUNDS - 1) as f32),
        };
        let within = |share: f32| report(span[0] + (span[1] - span[0]) * share);
        let schedule = if round == 0 { FIRST_SEARCH } else { CORRECTION };
        cancelled(match method {
            Method::GreedyExchange => greedy::exchange(&mut state, MOST_EXCHANGES, &within),
            Method::Annealing => anneal(&mut state, &schedule, &within),
        })?;
        let of_one_u = candidates.plan(&state.chosen, 1.0, source, objectives.prescription_gy);
        let trials = Trials::new(&anatomy.target, kernel, &of_one_u.seeds(), objectives.misplacement);
        let found = judge(&mut state, &samples, &engine, (&of_one_u, &trials, objectives))?;
        let prescription_gy = objectives.prescription_gy / state.strength_u();
        level = (level * trials.strengthening(prescription_gy).map_or(1.0, |f| f as f32)).clamp(1.0, HIGHEST_LEVEL);
        state.set_limits(self::limits(objectives, level, Some((&found.figures, &found.sampled))));
        if best.as_ref().is_none_or(|best| found.is_better_than(best)) {
            best = Some(found);
        }
        let is_met = |best: &Proposal| best.figures.beyond() == 0.0 && best.robust >= TRIALS_KEPT;
        if best.as_ref().is_some_and(is_met) {
            break;
        }
    }
    best.ok_or(PlanError::NoDose)
}

/// Anneals, and then moves each seed once more where that helps.
fn anneal(state: &mut State, schedule: &Schedule, report: &dyn Fn(f32) -> ControlFlow<()>) -> ControlFlow<()> {
    annealing::anneal(state, schedule, &|share| report(share * ANNEALED))?;
    greedy::exchange(state, 1, &|share| report(ANNEALED + (1.0 - ANNEALED) * share))
}

/// The limits with a small reserve, moved by what the sample points were wrong.
fn limits(objectives: &Objectives, level: f32, seen: Option<(&Figures, &Figures)>) -> Limits {
    let off = |of: fn(&Figures) -> f64| seen.map_or(0.0, |(full, sampled)| ((of(full) - of(sampled)) / 100.0) as f32);
    let ratio = |of: fn(&Figures) -> Option<f64>| {
        let both = seen.and_then(|(full, sampled)| of(full).zip(of(sampled)));
        both.map_or(1.0, |(full, sampled)| (sampled / full).clamp(0.8, 1.2) as f32)
    };
    Limits {
        level,
        most: 1.25 * 0.985,
        cold: (0.05 - 0.006 + off(|f| f.v100)).clamp(0.01, 0.1),
        hot: (0.60 - 0.008 - off(|f| f.v150)).clamp(0.4, 0.7),
        urethra_tenth: 1.5 * 0.985 * ratio(|f| f.urethra_d10),
        urethra_third: 1.3 * 0.985 * ratio(|f| f.urethra_d30),
        rectum: 0.97 * ratio(|f| f.rectum_d2cc),
        needles: objectives.needles,
    }
}

impl Proposal {
    /// Limits first, then what is left of the coverage when seeds miss their places.
    fn is_better_than(&self, other: &Self) -> bool {
        (self.figures.beyond(), -self.robust.min(TRIALS_KEPT))
            < (other.figures.beyond(), -other.robust.min(TRIALS_KEPT))
    }
}

/// The plan of a state with the strength that the full engine and the trials find best, which the state takes over.
fn judge(
    state: &mut State,
    samples: &Samples,
    engine: &Engine,
    (of_one_u, trials, objectives): (&ImplantPlan, &Trials, &Objectives),
) -> Result<Proposal, PlanError> {
    let histograms = engine.histograms(&of_one_u.seeds());
    let mut best: Option<Proposal> = None;
    for (strength, &strength_u) in objectives.strengths_u.iter().enumerate() {
        state.set_strength(strength);
        let found = Proposal {
            plan: of_one_u.with_strength(strength_u),
            figures: histograms
                .figures(strength_u, objectives.prescription_gy)
                .ok_or(PlanError::NoDose)?,
            sampled: Figures::of_samples(samples, &state.dose()).ok_or(PlanError::NoDose)?,
            robust: trials.kept(objectives.prescription_gy / strength_u),
            cost: state.cost,
            behind_bone: state.candidates.behind_bone,
        };
        if best.as_ref().is_none_or(|best| found.is_better_than(best)) {
            best = Some(found);
        }
    }
    let best = best.ok_or(PlanError::NoWay)?;
    let strength_u = best.plan.seeds().first().map_or(0.0, |seed| seed.strength_u);
    let strength = objectives.strengths_u.iter().position(|u| *u == strength_u);
    state.set_strength(strength.unwrap_or_default());
    Ok(best)
}

#[cfg(test)]
mod glands;
#[cfg(test)]
mod tests;
