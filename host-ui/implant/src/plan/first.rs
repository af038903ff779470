//! The automatic plan: inverse planning where the scene says what is to be spared, else modified peripheral loading.

use super::automatic::{self, Aims};
use super::optimise::{self, Method, Objectives};
use super::{Anatomy, ImplantPlan, PlanError, Template};
use std::ops::ControlFlow;
use stylet_dose::{DoseKernel, Source};

/// A plan, and what there is to know about how it was made.
#[derive(Clone, Debug)]
pub struct FirstPlan {
    /// The plan.
    pub plan: ImplantPlan,
    /// For people: what is beyond its limit and by how much, or why the plan was made without limits. Empty where all limits are kept.
    pub notes: Vec<String>,
}

/// What a plan without a known urethra says.
pub const NO_URETHRA: &str = "no urethra is known, so the plan only covers the target (modified peripheral loading)";

/// Needles, seeds and strength; an error where no needle fits. `report` gets the share that is done; where it breaks, the search is
/// cancelled.
pub fn plan(
    template: Template,
    anatomy: &Anatomy,
    kernel: &DoseKernel,
    source: &Source,
    prescription_gy: f64,
    report: impl Fn(f32) -> ControlFlow<()>,
) -> Result<FirstPlan, PlanError> {
    let [_, urethra, _] = optimise::bodies(anatomy);
    if urethra.is_none() {
        let aims = Aims::new(prescription_gy);
        return Ok(FirstPlan {
            plan: automatic::plan(template, anatomy, kernel, &source.model, &aims, report)?,
            notes: vec![NO_URETHRA.to_owned()],
        });
    }
    let objectives = Objectives::new(source, prescription_gy);
    let model = &source.model;
    let found = optimise::plan(template, anatomy, kernel, model, &objectives, Method::default(), report)?;
    Ok(FirstPlan {
        notes: found.figures.broken(),
        plan: found.plan,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::anatomy::ball;
    use crate::plan::template::PITCH_M;
    use stylet_anatomy::PatientFrame;
    use stylet_dose::decay::Interval;

    #[test]
    fn without_a_urethra_the_plan_is_the_peripheral_one_and_says_so() {
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
        let first = plan(template, &anatomy, &kernel, &source, 145.0, proceed).unwrap();
        let aims = Aims::new(145.0);
        let peripheral = automatic::plan(template, &anatomy, &kernel, "6711", &aims, proceed).unwrap();
        assert_eq!(first.plan, peripheral);
        assert_eq!(first.notes, [NO_URETHRA]);
    }
}
