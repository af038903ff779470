//! The automatic plan by inverse planning, and others to choose from.

use super::anatomy::DOSE_PITCH_M;
use super::optimise::{self, Objectives, Proposal, Search, Statistic};
use super::{Anatomy, ImplantPlan, PlanError, Template};
use std::ops::ControlFlow;
use stylet_dose::{DoseKernel, DosePoints, Dvh, Source};

/// Plan, with remarks on how it was made.
#[derive(Clone, Debug)]
pub struct FirstPlan {
    /// Short name that distinguishes it from the other proposals.
    pub name: &'static str,
    /// Description in a sentence.
    pub why: &'static str,
    /// The plan with its measures.
    pub found: Proposal,
    /// Remarks: limits that are violated and by how much, and an unknown urethra.
    pub notes: Vec<String>,
}

/// Remark on a plan without a known urethra.
const NO_URETHRA: &str = "no urethra is known, so its dose has no limit";
/// Cost of a needle in a plan with few of them.
const FEW_NEEDLES: f32 = 6e-3;
/// Share of the target that gets the prescription at that strength.
const COVERED: f64 = 0.96;

/// Makes the first `count` of three plans to choose from, the usual one first; returns an error if
/// no needle fits. `report` gets the completed share; if it breaks, the search is cancelled.
pub fn proposals(
    template: Template,
    anatomy: &Anatomy,
    kernel: &DoseKernel,
    source: &Source,
    objectives: &Objectives,
    count: usize,
    report: impl Fn(f32) -> ControlFlow<()>,
) -> Result<Vec<FirstPlan>, PlanError> {
    let search = Search::new(template, anatomy, kernel, &source.model, objectives, &|_| report(0.0))?;
    let few = Objectives {
        needle_cost: FEW_NEEDLES,
        ..objectives.clone()
    };
    let planned = Objectives {
        robust: Statistic::Planned,
        ..objectives.clone()
    };
    let aims = [
        (
            "Robust",
            "95 % of trials with misplaced seeds meet a D90 of 90 % of the prescription; then the smallest V150.",
            objectives,
        ),
        (
            "Fewer needles",
            "As robust, with as few needles as possible; its V150 may be larger.",
            &few,
        ),
        (
            "Lower V150",
            "Optimised for the planned dose alone: the smallest V150, but misplaced seeds cost more coverage.",
            &planned,
        ),
    ];
    let count = count.min(aims.len());
    let [_, urethra, _] = optimise::bodies(anatomy);
    let find = |(number, (name, why, objectives)): (usize, (_, _, &Objectives))| {
        let found = search.find(objectives, &|share| report((number as f32 + share) / count as f32))?;
        let mut notes = found.figures.broken();
        notes.extend(urethra.is_none().then(|| NO_URETHRA.to_owned()));
        Ok(FirstPlan {
            name,
            why,
            found,
            notes,
        })
    };
    aims.into_iter().take(count).enumerate().map(find).collect()
}

/// Returns the strength, U, at which 96 % of the target gets the prescription: dose is linear in it.
pub fn strength_u(plan: &ImplantPlan, anatomy: &Anatomy, kernel: &DoseKernel) -> Result<f64, PlanError> {
    let target = anatomy.target.structure(DOSE_PITCH_M);
    let dose_gy = DosePoints::new(&target.points_m).of_seeds_gy(kernel, &plan.with_strength(1.0).seeds());
    let dvh = Dvh::new(&dose_gy, &target.volumes_m3);
    let reached = dvh.and_then(|d| d.dose_of_gy(COVERED * d.volume_m3()));
    let reached_gy = reached.filter(|gy| *gy > 0.0).ok_or(PlanError::NoDose)?;
    Ok(plan.prescription_gy / reached_gy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::check::problems;
    use crate::plan::optimise::tests::glands::{GLANDS, TEMPLATE};
    use stylet_dose::decay::Interval;

    /// Tests a scene like `paper`, which names no structure to be spared.
    #[test]
    fn a_plan_without_a_urethra_keeps_its_limits_and_says_so() {
        let mut anatomy = GLANDS[0].anatomy();
        anatomy.spared.clear();
        let source = Source::known("6711").unwrap();
        let kernel = DoseKernel::new(&source, Interval::ALL);
        let (objectives, proceed) = (Objectives::new(&source, 145.0), |_| ControlFlow::Continue(()));
        let first = proposals(TEMPLATE, &anatomy, &kernel, &source, &objectives, 1, proceed).unwrap();
        assert_eq!(first[0].notes, [NO_URETHRA]);
        let plan = &first[0].found.plan;
        assert!(problems(plan, &anatomy).is_empty() && plan.needles.len() <= 25);
        // The plan covers more, so seeds for 96 % may be weaker.
        let strength_u = strength_u(plan, &anatomy, &kernel).unwrap();
        assert!(
            (0.5..1.0).contains(&(strength_u / plan.needles[0].seeds[0].strength_u)),
            "{strength_u}"
        );
    }
}
