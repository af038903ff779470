//! The parameters in force as announced by the core, and a refusal of parameters in reason codes.

use crate::{ParameterId, ParameterProblem, ParameterProblems, ParameterSet, Reason, Refusal, RefusalCode};
use bytemuck::{Pod, Zeroable};

/// The parameters in force, written by the bridge after each change.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ParametersInForce {
    /// The run of the core.
    pub session_id: u64,
    /// Rises with each change that took effect.
    pub generation: u64,
    /// First tick of the force loop that ran with them; the limits of the tissue hold from the next tick of the tissue
    /// loop on.
    pub effective_tick: u64,
    /// All values.
    pub set: ParameterSet,
}

fn code(problem: &ParameterProblem) -> RefusalCode {
    match problem {
        ParameterProblem::OutOfLimits { .. } => RefusalCode::ParameterOutOfLimits,
        ParameterProblem::CellsFold { .. } => RefusalCode::CellsFold,
        ParameterProblem::TooStiff { .. } => RefusalCode::TooStiff,
        ParameterProblem::Unusable(_) => RefusalCode::ParametersUnusable,
    }
}

impl From<ParameterProblems> for Refusal {
    fn from(problems: ParameterProblems) -> Self {
        let reasons = problems.0.iter().flat_map(|problem| {
            let code = code(problem);
            let subjects = problem.parameters().iter().map(|&id| id as u32);
            let none = problem.parameters().is_empty().then_some(Reason::NO_SUBJECT);
            subjects.chain(none).map(move |subject| Reason::new(code, subject))
        });
        Self {
            reasons: reasons.collect(),
            text: problems.to_string(),
        }
    }
}

impl Reason {
    /// Returns the parameter concerned.
    pub fn parameter(&self) -> Option<ParameterId> {
        let of_parameter = [
            RefusalCode::ParameterOutOfLimits,
            RefusalCode::CellsFold,
            RefusalCode::TooStiff,
        ];
        let code = self.code().filter(|code| of_parameter.contains(code));
        code.and_then(|_| ParameterId::from_number(self.subject))
    }
}
