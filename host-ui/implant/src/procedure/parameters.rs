//! Parameters that a headless procedure sets before it begins.

use super::error::ProcedureError;
use super::wait;
use std::time::Duration;
use stylet_base::interrupt::Interrupt;
use stylet_host::link::Link;
use stylet_shm_schema::{PARAMETERS, ParameterChange, ParameterProblem, Request};

const LIMIT: Duration = Duration::from_secs(5);

/// Error of a text that is not a parameter; it says what is allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoParameter {
    /// The text is not a pair.
    #[error("{0}: write KEY=VALUE, such as needle.bending_stiffness=0.016")]
    NoPair(String),
    /// The key is not in the table.
    #[error("{0}: no such parameter; valid keys are {keys}", keys = keys())]
    UnknownKey(String),
    /// The value cannot be read.
    #[error("{key}: {value} is not a number")]
    NoNumber {
        /// The parameter.
        key: &'static str,
        /// Text that was given.
        value: String,
    },
    /// The table forbids the value.
    #[error(transparent)]
    OutOfLimits(#[from] ParameterProblem),
}

fn keys() -> String {
    PARAMETERS.map(|spec| spec.key).join(", ")
}

/// Parses `KEY=VALUE` of the command line, in the window's unit.
pub fn parameter(text: &str) -> Result<ParameterChange, NoParameter> {
    let (key, value) = text
        .split_once('=')
        .ok_or_else(|| NoParameter::NoPair(text.to_owned()))?;
    let spec = PARAMETERS.iter().find(|spec| spec.key == key);
    let spec = spec.ok_or_else(|| NoParameter::UnknownKey(key.to_owned()))?;
    let given: f64 = value.parse().map_err(|_| NoParameter::NoNumber {
        key: spec.key,
        value: value.to_owned(),
    })?;
    let si = given / spec.display_per_si;
    // The factor to the display unit and back may leave the limits by a bit.
    let within = si.clamp(spec.min, spec.max);
    let value = if (si - within).abs() > 1e-9 * spec.max.abs() {
        si
    } else {
        within
    };
    match spec.problem(value) {
        Some(problem) => Err(problem.into()),
        None => Ok(ParameterChange { id: spec.id, value }),
    }
}

/// Sends parameters and waits until they are in force.
pub(super) fn set(link: &mut Link, changes: &[ParameterChange], interrupted: &Interrupt) -> Result<(), ProcedureError> {
    if changes.is_empty() {
        return Ok(());
    }
    let id = link.send(&Request::SetParameters(changes.to_vec()))?;
    let are_set = wait(link, interrupted, LIMIT, |link| {
        if let Some(Err(refusal)) = link.reply(id) {
            return Err(ProcedureError::ParametersRefused(refusal));
        }
        let now = link.parameters().map(|p| p.set);
        Ok(now.is_some_and(|set| changes.iter().all(|c| set.get(c.id).to_bits() == c.value.to_bits())))
    })?;
    if are_set {
        Ok(())
    } else {
        Err(ProcedureError::NothingReceived(
            "the core did not apply the parameters in time",
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_shm_schema::ParameterId;

    #[test]
    fn parameters_use_the_window_s_unit() {
        let change = parameter("needle.template_gap=0.2").expect("valid");
        assert_eq!(change.id, ParameterId::TemplateGap);
        assert!((change.value - 2e-4).abs() < 1e-15);
        assert!(parameter("needle.template_gap=3").is_ok(), "the limit itself");
        for (text, says) in [
            ("needle.template_gap", "KEY=VALUE"),
            ("needle.gap=1", "valid keys are tissue.min_stretch"),
            ("needle.template_gap=wide", "not a number"),
            ("needle.template_gap=9", "0.000000 to 3.000000 mm"),
            ("needle.template_gap=NaN", "not a number"),
        ] {
            let why = parameter(text).expect_err(text).to_string();
            assert!(why.contains(says), "{why}");
        }
    }
}
