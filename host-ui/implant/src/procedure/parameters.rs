//! Parameters that a procedure without a window sets before it begins.

use super::error::ProcedureError;
use super::wait;
use std::time::Duration;
use stylet_base::interrupt::Interrupt;
use stylet_host::link::Link;
use stylet_shm_schema::{PARAMETERS, ParameterChange, Request};

const LIMIT: Duration = Duration::from_secs(5);

/// `KEY=VALUE` of the command line, in the unit that the window shows.
///
/// # Errors
///
/// No such key, no number, or one out of its limits; the text says what is allowed.
pub fn parameter(text: &str) -> Result<ParameterChange, String> {
    let (key, value) = text
        .split_once('=')
        .ok_or_else(|| format!("{text}: write KEY=VALUE, such as needle.bending_stiffness=0.016"))?;
    let Some(spec) = PARAMETERS.iter().find(|spec| spec.key == key) else {
        let keys: Vec<&str> = PARAMETERS.iter().map(|spec| spec.key).collect();
        return Err(format!("{key}: there is no such parameter; there are {}", keys.join(", ")));
    };
    let read: f64 = value.parse().map_err(|_| format!("{key}: {value} is no number"))?;
    let si = read / spec.display_per_si;
    // The factor to a person's unit and back may leave the limits by a bit.
    let within = si.clamp(spec.min, spec.max);
    if !si.is_finite() || (si - within).abs() > 1e-9 * within.abs().max(spec.max.abs()) {
        let [least, most] = [spec.min, spec.max].map(|limit| limit * spec.display_per_si);
        return Err(format!("{key}: {value} is outside of {least} to {most} {}", spec.unit));
    }
    Ok(ParameterChange {
        id: spec.id,
        value: within,
    })
}

/// Waits until they are in force.
pub(super) fn set(
    link: &mut Link,
    changes: &[ParameterChange],
    interrupted: &Interrupt,
) -> Result<(), ProcedureError> {
    if changes.is_empty() {
        return Ok(());
    }
    let id = link.send(&Request::SetParameters(changes.to_vec()))?;
    let are_set = wait(link, interrupted, LIMIT, |link| {
        if let Some(answer) = link.reply(id).filter(|answer| !answer.accepted) {
            return Err(ProcedureError::ParametersRefused(answer.text));
        }
        let now = link.parameters().map(|p| p.set);
        Ok(now.is_some_and(|set| changes.iter().all(|c| set.get(c.id).to_bits() == c.value.to_bits())))
    })?;
    if are_set {
        Ok(())
    } else {
        Err(ProcedureError::NothingReceived("the core did not take the parameters up in time"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_shm_schema::ParameterId;

    #[test]
    fn a_parameter_is_read_in_the_unit_of_the_window() {
        let change = parameter("needle.template_gap=0.2").expect("valid");
        assert_eq!(change.id, ParameterId::TemplateGap);
        assert!((change.value - 2e-4).abs() < 1e-15);
        assert!(parameter("needle.template_gap=3").is_ok(), "the limit itself");
        for (text, says) in [
            ("needle.template_gap", "KEY=VALUE"),
            ("needle.gap=1", "there are tissue.min_stretch"),
            ("needle.template_gap=wide", "no number"),
            ("needle.template_gap=9", "0 to 3 mm"),
            ("needle.template_gap=NaN", "outside"),
        ] {
            let why = parameter(text).expect_err(text);
            assert!(why.contains(says), "{why}");
        }
    }
}
