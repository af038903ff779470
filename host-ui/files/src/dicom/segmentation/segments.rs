//! The segments of a file: their names, and the codes of their organs (SNOMED CT, and its older identifiers).

use super::super::super::element::short;
use super::super::values::{items, name, needed, text};
use crate::error::{ContentError, invalid};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use std::collections::BTreeMap;
use stylet_anatomy::Organ;

/// Coded concept: SNOMED CT, its older identifier, meaning.
pub type Code = (&'static str, &'static str, &'static str);

/// Codes of the organs (PS3.16: the context groups 7151, 7192 and 9534).
const CODES: [(Organ, Code); 9] = [
    (Organ::Prostate, ("41216001", "T-92000", "Prostate")),
    (Organ::TargetVolume, ("228793007", "R-429EC", "PTV")),
    (Organ::SeminalVesicle, ("64739004", "T-93000", "Seminal Vesicle")),
    (Organ::Urethra, ("13648007", "T-75000", "Urethra")),
    (Organ::Rectum, ("34402009", "T-59600", "Rectum")),
    (Organ::Bladder, ("89837001", "T-74000", "Bladder")),
    (Organ::Bone, ("272673000", "T-D016E", "Bone")),
    (Organ::Skin, ("39937001", "T-01000", "Skin")),
    (Organ::Perineum, ("38864007", "T-D2700", "Perineum")),
];
/// Category of organs.
const ANATOMY: Code = ("123037004", "T-D000A", "Anatomical Structure");
/// Category and type of everything else.
const TISSUE: Code = ("85756007", "T-D0050", "Tissue");

/// Returns category and type for the name of a structure.
pub fn codes_of(name: &str) -> [Code; 2] {
    let organ = Organ::of_name(name);
    let known = CODES.iter().find(|(of, _)| Some(*of) == organ);
    known.map_or([TISSUE; 2], |(_, code)| [ANATOMY, *code])
}

/// Segments of a file.
pub struct Segments {
    /// Names by number.
    pub names: BTreeMap<u8, String>,
    /// Remarks on the names.
    pub notes: Vec<String>,
}

impl Segments {
    pub fn of(data: &InMemDicomObject) -> Result<Self, ContentError> {
        let (mut names, mut notes) = (BTreeMap::new(), Vec::new());
        for item in items(data, tags::SEGMENT_SEQUENCE) {
            // A label map may describe its background.
            let number = needed(item, tags::SEGMENT_NUMBER, 0.0, 255.0)? as u8;
            let (name_of, note) = called(item, number);
            notes.extend(note);
            if number != 0 && names.insert(number, name_of).is_some() {
                return Err(invalid!(
                    "two of its segments have the number {number} ({})",
                    name(tags::SEGMENT_NUMBER)
                ));
            }
        }
        if names.is_empty() {
            return Err(invalid!("it describes no segments ({})", name(tags::SEGMENT_SEQUENCE)));
        }
        Ok(Self { names, notes })
    }
}

/// Returns the name of a segment: its label, with the organ of its type in front where the label
/// names none.
fn called(segment: &InMemDicomObject, number: u8) -> (String, Option<String>) {
    let code = items(segment, tags::SEGMENTED_PROPERTY_TYPE_CODE_SEQUENCE).first();
    let of_code = |tag| code.and_then(|code| text(code, tag)).unwrap_or_default();
    let (value, meaning) = (of_code(tags::CODE_VALUE), of_code(tags::CODE_MEANING));
    let row = CODES
        .iter()
        .find(|(_, (code, older, _))| value == *code || value == *older);
    let coded = row.map(|(organ, _)| *organ).or_else(|| Organ::of_name(&meaning));
    let word = match row {
        Some((_, (.., word))) => (*word).to_owned(),
        None => meaning.clone(),
    };
    let type_code = name(tags::SEGMENTED_PROPERTY_TYPE_CODE_SEQUENCE);
    let Some(label) = text(segment, tags::SEGMENT_LABEL) else {
        let called = if word.is_empty() {
            format!("segment {number}")
        } else {
            word
        };
        let note = format!(
            "{} of segment {number} is missing; it is called \"{called}\"",
            name(tags::SEGMENT_LABEL)
        );
        return (called, Some(note));
    };
    let shown = short(&label);
    match (Organ::of_name(&label), coded) {
        (Some(named), Some(coded)) if named.role() != coded.role() => {
            let note = format!(
                "its segment \"{shown}\" is of type \"{}\" by {type_code}; the name counts",
                short(&meaning)
            );
            (label, Some(note))
        }
        (None, Some(_)) => {
            let called = format!("{word} ({label})");
            let note = format!(
                "its segment \"{shown}\" is called \"{}\", by {type_code}",
                short(&called)
            );
            (called, Some(note))
        }
        (None, None) if value.is_empty() => {
            let note = format!("{type_code} of segment \"{shown}\" is missing");
            (label, Some(note))
        }
        _ => (label, None),
    }
}
