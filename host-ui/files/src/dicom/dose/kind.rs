//! Meaning of a dose: of which type, and of how much of a plan. Other formats keep it as lines.

use super::super::super::element::short;
use super::super::values::{name, text};
use crate::error::{ContentError, invalid};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;

const PHYSICAL: &str = "PHYSICAL";
/// Type of differences, the only one that may be negative.
pub const ERROR: &str = "ERROR";
const TYPES: [&str; 3] = [PHYSICAL, "EFFECTIVE", ERROR];
const PLAN: &str = "PLAN";
const SUMMATIONS: [&str; 11] = [
    PLAN,
    "MULTI_PLAN",
    "PLAN_OVERVIEW",
    "FRACTION",
    "BEAM",
    "BRACHY",
    "FRACTION_SESSION",
    "BEAM_SESSION",
    "BRACHY_SESSION",
    "CONTROL_POINT",
    "RECORD",
];
/// Names in other formats.
const TYPE_LINE: &str = "dose_type";
const SUMMATION_LINE: &str = "dose_summation";

/// Type and summation of a dose, in the words of DICOM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DoseKind {
    /// PHYSICAL, EFFECTIVE or ERROR.
    pub dose_type: String,
    /// PLAN, or the part of a plan or a treatment.
    pub summation: String,
}

impl Default for DoseKind {
    fn default() -> Self {
        Self {
            dose_type: PHYSICAL.to_owned(),
            summation: PLAN.to_owned(),
        }
    }
}

impl DoseKind {
    /// Reads type and summation, with remarks on what is missing.
    pub fn of(data: &InMemDicomObject) -> Result<(Self, Vec<String>), ContentError> {
        let mut notes = Vec::new();
        let mut one = |tag, known: &[&str]| match text(data, tag) {
            None => {
                notes.push(format!("{} is missing; {} is assumed", name(tag), known[0]));
                Ok(known[0].to_owned())
            }
            Some(value) if known.contains(&value.as_str()) => Ok(value),
            Some(value) => Err(invalid!(
                "{} is \"{}\"; it must be one of {}",
                name(tag),
                short(&value),
                known.join(", ")
            )),
        };
        let kind = Self {
            dose_type: one(tags::DOSE_TYPE, &TYPES)?,
            summation: one(tags::DOSE_SUMMATION_TYPE, &SUMMATIONS)?,
        };
        notes.extend(kind.remarks());
        Ok((kind, notes))
    }

    /// Reads the lines of another format, given by their names; the dose of a plan without them.
    pub fn of_lines(line: impl Fn(&str) -> Option<String>) -> Self {
        let one = |of: &str, known: &[&str]| {
            let value = line(of).filter(|value| known.contains(&value.as_str()));
            value.unwrap_or_else(|| known[0].to_owned())
        };
        Self {
            dose_type: one(TYPE_LINE, &TYPES),
            summation: one(SUMMATION_LINE, &SUMMATIONS),
        }
    }

    /// Returns remarks on a dose that is not the physical one of a plan.
    pub fn remarks(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.dose_type != PHYSICAL {
            notes.push(format!(
                "{} is {}: it is not the physical dose",
                name(tags::DOSE_TYPE),
                self.dose_type
            ));
        }
        if self.summation != PLAN {
            notes.push(format!(
                "{} is {}: it is not the dose of one plan",
                name(tags::DOSE_SUMMATION_TYPE),
                self.summation
            ));
        }
        notes
    }

    /// Refuses to compare doses of different types.
    pub fn comparable(&self, other: &Self) -> Result<(), ContentError> {
        if self.dose_type == other.dose_type {
            return Ok(());
        }
        Err(invalid!(
            "{} is {}, and that of the other dose {}; give doses of one type",
            name(tags::DOSE_TYPE),
            other.dose_type,
            self.dose_type
        ))
    }

    /// Refuses to write what only refers to a part of a plan: the references to it are not kept.
    pub(super) fn writable(&self) -> Result<(), ContentError> {
        if self.summation == PLAN {
            return Ok(());
        }
        Err(invalid!(
            "{} is {}, and only the dose of a whole plan is written as RT Dose; convert it to .nrrd or .csv",
            name(tags::DOSE_SUMMATION_TYPE),
            self.summation
        ))
    }

    /// Returns comment lines for a table; none for the dose of a plan.
    pub fn comments(&self) -> String {
        self.lines(|line, value| format!("# {line}: {value}\n"))
    }

    /// Returns pairs of the header of an NRRD file.
    pub fn pairs(&self) -> String {
        self.lines(|line, value| format!("{line}:={value}\n"))
    }

    fn lines(&self, line: impl Fn(&str, &str) -> String) -> String {
        let usual = Self::default();
        let mut lines = String::new();
        for (name, value, usual) in [
            (TYPE_LINE, &self.dose_type, &usual.dose_type),
            (SUMMATION_LINE, &self.summation, &usual.summation),
        ] {
            if value != usual {
                lines += &line(name, value);
            }
        }
        lines
    }
}
