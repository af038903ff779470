//! Application setups that a plan applies: those that a fraction group names.

use super::super::values::{items, name, needed, number};
use crate::error::{ContentError, invalid};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;

/// Returns the setups of the fraction groups, and remarks. A plan whose groups name none has all of
/// them.
///
/// # Errors
///
/// A number that is given twice, or that a group names and no setup has.
pub fn of(data: &InMemDicomObject) -> Result<(Vec<&InMemDicomObject>, Vec<String>), ContentError> {
    let mut all: Vec<(f64, &InMemDicomObject)> = Vec::new();
    let setups = items(data, tags::APPLICATION_SETUP_SEQUENCE);
    for setup in setups {
        // One setup is known without a number.
        let setup_number = match setups.len() {
            1 => number(setup, tags::APPLICATION_SETUP_NUMBER)?.unwrap_or_default(),
            _ => needed(setup, tags::APPLICATION_SETUP_NUMBER, 0.0, 1e9)?,
        };
        if all.iter().any(|(other, _)| *other == setup_number) {
            return Err(invalid!(
                "{} {setup_number} is given twice",
                name(tags::APPLICATION_SETUP_NUMBER)
            ));
        }
        all.push((setup_number, setup));
    }
    let groups = items(data, tags::FRACTION_GROUP_SEQUENCE);
    let mut notes = Vec::new();
    let mut referred: Vec<f64> = Vec::new();
    for group in groups {
        for reference in items(group, tags::REFERENCED_BRACHY_APPLICATION_SETUP_SEQUENCE) {
            referred.push(needed(
                reference,
                tags::REFERENCED_BRACHY_APPLICATION_SETUP_NUMBER,
                0.0,
                1e9,
            )?);
        }
        let fractions = number(group, tags::NUMBER_OF_FRACTIONS_PLANNED)?.unwrap_or(1.0);
        if fractions != 1.0 {
            notes.push(format!(
                "{} is {fractions}; the sources of a permanent implant count once",
                name(tags::NUMBER_OF_FRACTIONS_PLANNED)
            ));
        }
    }
    let count = |setup: &InMemDicomObject| items(setup, tags::CHANNEL_SEQUENCE).len();
    if referred.is_empty() {
        if all.len() > 1 {
            notes.push(format!(
                "no fraction group names an application setup ({}), so all {} of them count",
                name(tags::REFERENCED_BRACHY_APPLICATION_SETUP_SEQUENCE),
                all.len()
            ));
        }
        return Ok((all.into_iter().map(|(_, setup)| setup).collect(), notes));
    }
    if let Some(missing) = referred.iter().find(|number| !all.iter().any(|(of, _)| of == *number)) {
        return Err(invalid!(
            "{} names application setup {missing}, which is missing",
            name(tags::REFERENCED_BRACHY_APPLICATION_SETUP_NUMBER)
        ));
    }
    let (used, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|(number, _)| referred.contains(number));
    notes.extend(others.iter().map(|(number, setup)| {
        format!(
            "application setup {number} with {} channels is left out: no fraction group names it",
            count(setup)
        )
    }));
    Ok((used.into_iter().map(|(_, setup)| setup).collect(), notes))
}
