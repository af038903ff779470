//! The automatic plan: inverse planning if the scene names structures to be spared, else modified
//! peripheral loading.

use super::automatic::{self, Aims};
use super::optimise::{self, Figures, Method, Objectives, Proposal, Search, Statistic};
use super::{Anatomy, ImplantPlan, PlanError, Template};
use std::ops::ControlFlow;
use stylet_dose::{DoseKernel, Source};

/// Plan, with remarks on how it was made.
#[derive(Clone, Debug)]
pub struct FirstPlan {
    /// Short name that distinguishes it from the other proposals.
    pub name: &'static str,
    /// Description in a sentence.
    pub why: &'static str,
    /// The plan.
    pub plan: ImplantPlan,
    /// Measures of the plan; `None` if it was made without limits.
    pub measures: Option<Measures>,
    /// Remarks: limits that are violated and by how much, or why the plan was made without limits.
    /// Empty if all limits are met.
    pub notes: Vec<String>,
}

/// Measures by which proposals are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// Measures of the dose.
    pub figures: Figures,
    /// Share of trials with misplaced seeds whose D90 is at least 90 % of the prescription.
    pub robust: f64,
    /// Mean D90 of those trials, percent of the prescription.
    pub expected_d90: f64,
    /// D90 that nine of ten of those trials reach, percent of the prescription.
    pub d90_p10: f64,
}

/// Remark on a plan without a known urethra.
pub const NO_URETHRA: &str = "no urethra is known, so the plan only covers the target (modified peripheral loading)";
/// Cost of a needle in a plan with few of them.
const FEW_NEEDLES: f32 = 6e-3;

/// Makes one plan for the objectives; returns an error if no needle fits. `report` gets the
/// completed share; if it breaks, the search is cancelled.
pub fn plan(
    template: Template,
    anatomy: &Anatomy,
    kernel: &DoseKernel,
    source: &Source,
    objectives: &Objectives,
    report: impl Fn(f32) -> ControlFlow<()>,
) -> Result<FirstPlan, PlanError> {
    let [_, urethra, _] = optimise::bodies(anatomy);
    if urethra.is_none() {
        return peripheral(template, anatomy, kernel, source, objectives, report);
    }
    let search = Search::new(template, anatomy, kernel, &source.model, objectives, &report)?;
    let found = search.find(objectives, Method::default(), &report)?;
    Ok(FirstPlan::of("Robust", ROBUST, found))
}

/// Makes several plans to choose from, the usual one first; only one without a known urethra.
/// `report` as for [`plan`].
pub fn proposals(
    template: Template,
    anatomy: &Anatomy,
    kernel: &DoseKernel,
    source: &Source,
    objectives: &Objectives,
    report: impl Fn(f32) -> ControlFlow<()>,
) -> Result<Vec<FirstPlan>, PlanError> {
    let [_, urethra, _] = optimise::bodies(anatomy);
    if urethra.is_none() {
        return Ok(vec![peripheral(template, anatomy, kernel, source, objectives, report)?]);
    }
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
        ("Robust", ROBUST, objectives),
        (
            "Fewer needles",
            "Robust as well, with as few needles as possible.",
            &few,
        ),
        (
            "Lower V150",
            "Optimised for the planned dose alone: the smallest V150, but misplaced seeds cost more coverage.",
            &planned,
        ),
    ];
    let count = aims.len() as f32;
    let find = |(number, (name, why, objectives)): (usize, (_, _, &Objectives))| {
        let found = search.find(objectives, Method::default(), &|share| {
            report((number as f32 + share) / count)
        })?;
        Ok(FirstPlan::of(name, why, found))
    };
    aims.into_iter().enumerate().map(find).collect()
}

const ROBUST: &str = "Most trials with misplaced seeds meet a D90 of 90 % of the prescription.";

fn peripheral(
    template: Template,
    anatomy: &Anatomy,
    kernel: &DoseKernel,
    source: &Source,
    objectives: &Objectives,
    report: impl Fn(f32) -> ControlFlow<()>,
) -> Result<FirstPlan, PlanError> {
    let aims = Aims::new(objectives.prescription_gy);
    Ok(FirstPlan {
        name: "Peripheral",
        why: "Modified peripheral loading.",
        plan: automatic::plan(template, anatomy, kernel, &source.model, &aims, report)?,
        measures: None,
        notes: vec![NO_URETHRA.to_owned()],
    })
}

impl FirstPlan {
    fn of(name: &'static str, why: &'static str, found: Proposal) -> Self {
        Self {
            name,
            why,
            notes: found.figures.broken(),
            measures: Some(Measures {
                figures: found.figures,
                robust: found.robust,
                expected_d90: found.expected_d90,
                d90_p10: found.d90_p10,
            }),
            plan: found.plan,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::anatomy::ball;
    use crate::plan::template::PITCH_M;
    use stylet_anatomy::PatientFrame;
    use stylet_dose::decay::Interval;

    #[test]
    fn without_a_urethra_the_plan_is_peripheral() {
        let middle_m = [0.05, 0.05, 0.06];
        let template = Template {
            middle_m: [0.05, 0.05, -0.01],
            columns: [-1.0, 0.0, 0.0],
            rows: [0.0, 1.0, 0.0],
            inwards: [0.0, 0.0, 1.0],
            pitch_m: PITCH_M,
        };
        let anatomy = Anatomy {
            target: ball("gland", middle_m, [0.02, 0.0165, 0.018]),
            spared: Vec::new(),
            bone: Vec::new(),
            lower_m: [0.0; 3],
            upper_m: [0.1; 3],
            patient: PatientFrame::default(),
        };
        let source = Source::known("6711").unwrap();
        let kernel = DoseKernel::new(&source, Interval::ALL);
        let proceed = |_| ControlFlow::Continue(());
        let objectives = Objectives::new(&source, 145.0);
        let first = plan(template, &anatomy, &kernel, &source, &objectives, proceed).unwrap();
        let aims = Aims::new(145.0);
        let peripheral = automatic::plan(template, &anatomy, &kernel, "6711", &aims, proceed).unwrap();
        assert_eq!(first.plan, peripheral);
        assert_eq!(first.notes, [NO_URETHRA]);
    }
}
