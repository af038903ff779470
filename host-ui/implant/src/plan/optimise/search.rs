//! The search: a greedy choice from several strengths, annealing of the best of them, and
//! corrections by the full dose engine.

use super::annealing::{self, Schedule};
use super::candidates::Candidates;
use super::figures::{Engine, Figures};
use super::objective::{Expected, Limits};
use super::robust::Trials;
use super::samples::Samples;
use super::state::State;
use super::{Objectives, Proposal, bodies, greedy};
use crate::plan::dose::{DoseKernel, Seed};
use crate::plan::{Anatomy, PlanError, Template};
use std::ops::ControlFlow;

/// Indices in the catalogue at which a search may begin, 0.36, 0.44 and 0.52 U for I-125; the
/// cheapest greedy choice is used.
const FIRST_STRENGTHS: [usize; 3] = [3, 7, 11];
/// Number of catalogue steps by which another attempt begins weaker, if no plan meets all
/// requirements. More and weaker seeds depend less on each of them, and annealing hardly changes
/// the strength by much.
const WEAKER: usize = 6;
/// Number of searches, each corrected by the full engine.
const ROUNDS: usize = 3;
const FIRST_SEARCH: Schedule = Schedule {
    moves: 90_000,
    temperatures: [0.006, 0.0003],
};
const CORRECTION: Schedule = Schedule {
    moves: 20_000,
    temperatures: [0.002, 0.0003],
};
/// Share of the shortfall below which another correction of an attempt is made.
const WORTHWHILE: f64 = 0.6;
/// Reported shares after the samples, and after each attempt.
const ATTEMPTED: [f32; 4] = [0.05, 0.6, 0.8, 1.0];
/// Reported shares of an attempt after its greedy choice, and after its first round.
const GREEDY: f32 = 0.05;
const SEARCHED: f32 = 0.7;
/// Share of annealing in a round.
const ANNEALED: f32 = 0.7;
/// Dose to be kept with misplaced seeds, as a share of the prescription: initial and largest.
const FIRST_KEPT: f32 = 0.9;
const HIGHEST_KEPT: f32 = 1.1;
/// Dose for the target, as a share of the prescription.
const LEVEL: f32 = 1.0;

type Report<'a> = &'a dyn Fn(f32) -> ControlFlow<()>;

/// Data computed once for all plans of an anatomy.
pub struct Search<'a> {
    anatomy: &'a Anatomy,
    kernel: &'a DoseKernel,
    source: String,
    candidates: Candidates,
    samples: Samples,
    engine: Engine<'a>,
    /// Seeds in the tissue, each with its strength per U of the added ones.
    present: Vec<Seed>,
}

impl<'a> Search<'a> {
    /// Computes doses of all places; prescription, strengths, misplacement and present seeds come
    /// from `objectives`. `report` gets the completed share; if it breaks, the search is cancelled.
    pub fn new(
        template: Template,
        anatomy: &'a Anatomy,
        kernel: &'a DoseKernel,
        source: &str,
        objectives: &Objectives,
        report: Report<'_>,
    ) -> Result<Self, PlanError> {
        go_on(report(0.0))?;
        let candidates = Candidates::new(&template, anatomy, &objectives.present.holes);
        let strengths_u = &objectives.strengths_u;
        if candidates.ways.is_empty() || strengths_u.is_empty() {
            return Err(PlanError::NoWay);
        }
        if strengths_u.len() > 1 && !objectives.present.seeds.is_empty() {
            return Err(PlanError::Strengths);
        }
        let per_u = |seed: &Seed| Seed {
            strength_u: seed.strength_u / strengths_u[0],
            ..*seed
        };
        let present: Vec<Seed> = objectives.present.seeds.iter().map(per_u).collect();
        let bodies = bodies(anatomy);
        let usual = (objectives.prescription_gy, strengths_u[strengths_u.len() / 2]);
        let samples = Samples::new(bodies, &candidates, kernel, usual, objectives.misplacement, &present);
        go_on(report(ATTEMPTED[0]))?;
        Ok(Self {
            anatomy,
            kernel,
            source: source.to_owned(),
            candidates,
            samples,
            engine: Engine::new(kernel, bodies),
            present,
        })
    }

    /// Returns a plan for these objectives, which differ from those of [`Search::new`] in needles
    /// and robustness alone.
    pub fn find(&self, objectives: &Objectives, report: Report<'_>) -> Result<Proposal, PlanError> {
        let mut best: Option<Proposal> = None;
        let mut first_strengths = FIRST_STRENGTHS.to_vec();
        for attempt in 1..ATTEMPTED.len() {
            let [from, to] = [attempt - 1, attempt].map(|n| ATTEMPTED[n]);
            let within = |share: f32| report(from + (to - from) * share);
            let mut state = self.begin(objectives, &first_strengths, &within)?;
            self.attempt(&mut state, objectives, &mut best, &within)?;
            if best.as_ref().is_some_and(Proposal::is_as_asked) || state.strength == 0 {
                break;
            }
            first_strengths = vec![state.strength.saturating_sub(WEAKER)];
        }
        best.ok_or(PlanError::NoDose)
    }

    /// Continues the search from a state, and leaves a better plan in `best`. Ends when all
    /// requirements are met, or when a correction did not help much.
    fn attempt(
        &self,
        state: &mut State,
        objectives: &Objectives,
        best: &mut Option<Proposal>,
        report: Report<'_>,
    ) -> Result<(), PlanError> {
        let (mut kept, mut short) = (FIRST_KEPT, f64::INFINITY);
        for round in 0..ROUNDS {
            let span = match round {
                0 => [GREEDY, SEARCHED],
                n => [n - 1, n].map(|n| SEARCHED + (1.0 - SEARCHED) * n as f32 / (ROUNDS - 1) as f32),
            };
            let within = |share: f32| report(span[0] + (span[1] - span[0]) * share);
            let schedule = if round == 0 { FIRST_SEARCH } else { CORRECTION };
            go_on(anneal(state, &schedule, &within))?;
            let (found, trials) = self.judge(state, objectives)?;
            let prescription_gy = objectives.prescription_gy / state.strength_u();
            let more = trials.strengthening(objectives.robust, prescription_gy);
            kept = (kept * more.map_or(1.0, |f| f as f32)).clamp(FIRST_KEPT, HIGHEST_KEPT);
            state.set_limits(limits(objectives, kept, Some((&found.figures, &found.sampled))));
            let is_hopeless = found.figures.beyond() == 0.0 && found.shortfall > WORTHWHILE * short;
            short = found.shortfall;
            if best.as_ref().is_none_or(|best| found.is_better_than(best)) {
                *best = Some(found);
            }
            if is_hopeless || best.as_ref().is_some_and(Proposal::is_as_asked) {
                break;
            }
        }
        Ok(())
    }

    /// Returns the cheapest greedy choice, from these strengths of the catalogue.
    fn begin<'s>(
        &'s self,
        objectives: &'s Objectives,
        first_strengths: &[usize],
        report: Report<'_>,
    ) -> Result<State<'s>, PlanError> {
        let (strengths_u, limits) = (&objectives.strengths_u, limits(objectives, FIRST_KEPT, None));
        let mut begun: Option<State> = None;
        let mut begins: Vec<usize> = first_strengths
            .iter()
            .map(|s| (*s).min(strengths_u.len() - 1))
            .collect();
        begins.dedup();
        for strength in begins {
            let mut state = State::empty(&self.candidates, &self.samples, strengths_u, strength, limits);
            go_on(greedy::build(&mut state, &|_| report(GREEDY)))?;
            if begun.as_ref().is_none_or(|begun| state.cost < begun.cost) {
                begun = Some(state);
            }
        }
        begun.ok_or(PlanError::NoWay)
    }

    /// Returns the plan of a state with the strength that the full engine and the trials find best,
    /// which the state adopts; and the trials of 1 U.
    fn judge(&self, state: &mut State, objectives: &Objectives) -> Result<(Proposal, Trials), PlanError> {
        let prescription_gy = objectives.prescription_gy;
        let of_one_u = self.candidates.plan(&state.chosen, 1.0, &self.source, prescription_gy);
        let seeds = of_one_u.seeds();
        let needles = of_one_u.needle_of_seeds();
        let histograms = self.engine.histograms(&[&seeds[..], &self.present].concat());
        let trials = Trials::new(
            &self.anatomy.target,
            self.kernel,
            (&seeds, &needles),
            &self.present,
            objectives.misplacement,
        );
        let mut best: Option<(usize, Proposal)> = None;
        for (strength, &strength_u) in objectives.strengths_u.iter().enumerate() {
            state.set_strength(strength);
            let of_prescription_gy = prescription_gy / strength_u;
            let percent = |gy: f64| gy / of_prescription_gy * 100.0;
            let found = Proposal {
                plan: of_one_u.with_strength(strength_u),
                figures: histograms
                    .figures(strength_u, prescription_gy)
                    .ok_or(PlanError::NoDose)?,
                sampled: Figures::of_samples(&self.samples, &state.dose()).ok_or(PlanError::NoDose)?,
                robust: trials.kept(of_prescription_gy),
                expected_d90: percent(trials.expected_gy()),
                d90_p10: percent(trials.kept_by_gy(0.9).unwrap_or(0.0)),
                shortfall: trials.shortfall(objectives.robust, of_prescription_gy),
            };
            if best.as_ref().is_none_or(|(_, best)| found.is_better_than(best)) {
                best = Some((strength, found));
            }
        }
        let (strength, best) = best.ok_or(PlanError::NoWay)?;
        state.set_strength(strength);
        Ok((best, trials))
    }
}

fn go_on(flow: ControlFlow<()>) -> Result<(), PlanError> {
    match flow {
        ControlFlow::Break(()) => Err(PlanError::Cancelled),
        ControlFlow::Continue(()) => Ok(()),
    }
}

/// Anneals, and then moves each seed once more if that helps.
fn anneal(state: &mut State, schedule: &Schedule, report: Report<'_>) -> ControlFlow<()> {
    annealing::anneal(state, schedule, &|share| report(share * ANNEALED))?;
    greedy::exchange(state, &|share| report(ANNEALED + (1.0 - ANNEALED) * share))
}

/// Returns the limits with a small reserve, shifted by the error of the sample points.
fn limits(objectives: &Objectives, kept: f32, seen: Option<(&Figures, &Figures)>) -> Limits {
    let off = |of: fn(&Figures) -> f64| seen.map_or(0.0, |(full, sampled)| ((of(full) - of(sampled)) / 100.0) as f32);
    let ratio = |of: fn(&Figures) -> Option<f64>| {
        let both = seen.and_then(|(full, sampled)| of(full).zip(of(sampled)));
        both.map_or(1.0, |(full, sampled)| (sampled / full).clamp(0.8, 1.2) as f32)
    };
    Limits {
        level: LEVEL,
        most: 1.25 * 0.985,
        cold: (0.05 - 0.006 + off(|f| f.v100)).clamp(0.01, 0.1),
        hot: (0.60 - 0.008 - off(|f| f.v150)).clamp(0.4, 0.7),
        urethra_tenth: 1.5 * 0.985 * ratio(|f| f.urethra_d10),
        urethra_third: 1.3 * 0.985 * ratio(|f| f.urethra_d30),
        rectum: 0.97 * ratio(|f| f.rectum_d2cc),
        expected: objectives.robust.cold().map(|cold| Expected { kept, cold }),
        needles: objectives.needles,
        of_needle: objectives.needle_cost,
    }
}
