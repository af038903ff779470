//! Prescription of a plan, and the structure that it is of.

use super::super::values::{items, name, number, text};
use super::PlannedOn;
use crate::error::{ContentError, invalid};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;

/// Largest plausible prescription; a larger number is in cGy.
const MOST_GY: f64 = 1000.0;
const LEAST_GY: f64 = 1e-3;
const TARGET: &str = "TARGET";

fn is_target(reference: &InMemDicomObject) -> bool {
    text(reference, tags::DOSE_REFERENCE_TYPE).as_deref() == Some(TARGET)
}

/// Returns the first prescription to a target, and remarks on others.
pub fn of(data: &InMemDicomObject) -> Result<(Option<f64>, Vec<String>), ContentError> {
    let (mut all, mut notes): (Vec<f64>, Vec<String>) = (Vec::new(), Vec::new());
    for reference in items(data, tags::DOSE_REFERENCE_SEQUENCE) {
        let Some(gy) = number(reference, tags::TARGET_PRESCRIPTION_DOSE)? else {
            if is_target(reference) {
                notes.push(format!("{} is missing", name(tags::TARGET_PRESCRIPTION_DOSE)));
            }
            continue;
        };
        if !is_target(reference) {
            notes.push(format!(
                "its {} of {gy} Gy is not used: {} is {}",
                name(tags::TARGET_PRESCRIPTION_DOSE),
                name(tags::DOSE_REFERENCE_TYPE),
                text(reference, tags::DOSE_REFERENCE_TYPE).unwrap_or_else(|| "missing".to_owned())
            ));
            continue;
        }
        if !(LEAST_GY..=MOST_GY).contains(&gy) {
            return Err(invalid!(
                "{} is {gy}; allowed are {LEAST_GY} to {MOST_GY} Gy: is it in cGy? Correct it in the planning system",
                name(tags::TARGET_PRESCRIPTION_DOSE)
            ));
        }
        all.push(gy);
    }
    if all.is_empty() && notes.is_empty() {
        notes.push(format!(
            "it has no prescription: {} is missing or empty",
            name(tags::DOSE_REFERENCE_SEQUENCE)
        ));
    }
    let others: Vec<String> = all
        .iter()
        .skip(1)
        .filter(|gy| **gy != all[0])
        .map(f64::to_string)
        .collect();
    if !others.is_empty() {
        notes.push(format!(
            "it has several prescriptions to targets ({}): {} Gy counts, and not {} Gy",
            name(tags::DOSE_REFERENCE_SEQUENCE),
            all[0],
            others.join(", ")
        ));
    }
    Ok((all.first().copied(), notes))
}

/// Returns the structure set of the plan, and the number of its target.
pub fn structure_set(data: &InMemDicomObject) -> Option<PlannedOn> {
    let referenced = items(data, tags::REFERENCED_STRUCTURE_SET_SEQUENCE).first()?;
    let target = items(data, tags::DOSE_REFERENCE_SEQUENCE)
        .iter()
        .filter(|reference| is_target(reference))
        .find_map(|r| number(r, tags::REFERENCED_ROI_NUMBER).ok().flatten());
    Some(PlannedOn {
        uid: text(referenced, tags::REFERENCED_SOP_INSTANCE_UID)?,
        target: target
            .filter(|n| (0.0..1e9).contains(n) && n.fract() == 0.0)
            .map(|n| n as usize),
    })
}
