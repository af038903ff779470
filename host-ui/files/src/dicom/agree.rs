//! Comparison of the files of one computation: another patient or another frame of reference is
//! refused, anything less is reported.

use super::super::element::short;
use super::Identity;
use super::values::name;
use crate::error::FileError;
use dicom_core::Tag;
use dicom_dictionary_std::tags;
use std::path::PathBuf;

/// Property that files must share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shared {
    /// Patient, frame of reference and usually the study: places of one mean places of the other.
    Frame,
    /// The patient alone: images of other days have frames of their own.
    Patient,
}

/// Files that may be used together.
#[derive(Clone, Debug, Default)]
pub struct Agreed {
    /// Identity of the first file that has one, with what it lacks from the others.
    pub identity: Option<Identity>,
    /// Remarks on files.
    pub notes: Vec<(PathBuf, String)>,
}

/// Compares every identity with each other one.
///
/// # Errors
///
/// Two patients, or two frames of reference if the frame is shared.
pub fn agree(all: &[(PathBuf, Identity)], shared: Shared) -> Result<Agreed, FileError> {
    let mut notes: Vec<(PathBuf, String)> = Vec::new();
    for (n, (path, identity)) in all.iter().enumerate() {
        for (other_path, other) in &all[..n] {
            let pair = Pair {
                identity,
                other,
                other_file: other_path.display().to_string(),
            };
            let found = pair.patient().and_then(|patient| {
                let frame = match shared {
                    Shared::Frame => pair.frame()?,
                    Shared::Patient => Vec::new(),
                };
                Ok([patient, frame].concat())
            });
            let found = found.map_err(|why| FileError::of(path, why))?;
            for note in found {
                // Once for each file, whatever it is compared with.
                if !notes.iter().any(|(of, _)| of == path) || !notes.iter().any(|(_, noted)| *noted == note) {
                    notes.push((path.clone(), note));
                }
            }
        }
    }
    let mut of_all = all.iter().map(|(_, identity)| identity.clone());
    let first = of_all.next();
    let identity = match shared {
        Shared::Frame => first.map(|first| of_all.fold(first, Identity::filled)),
        Shared::Patient => first,
    };
    Ok(Agreed { identity, notes })
}

/// An identity and another one that it is compared with.
struct Pair<'a> {
    identity: &'a Identity,
    other: &'a Identity,
    other_file: String,
}

impl Pair<'_> {
    fn patient(&self) -> Result<Vec<String>, String> {
        let (one, other, file) = (self.identity, self.other, &self.other_file);
        let differ = |a: &str, b: &str| !a.is_empty() && !b.is_empty() && a != b;
        if differ(&one.patient_id, &other.patient_id) {
            let (one, other) = (short(&one.patient_id), short(&other.patient_id));
            return Err(format!(
                "it is of patient \"{one}\" and not of \"{other}\" as {file} is; give files of one patient"
            ));
        }
        let (named, other_name) = (family(&one.patient_name), family(&other.patient_name));
        let mut notes = Vec::new();
        if one.patient_id.is_empty() || other.patient_id.is_empty() {
            if differ(&named, &other_name) {
                return Err(format!(
                    "it is of patient \"{}\" and not of \"{}\" as {file} is, and {} is missing; give files of one patient",
                    short(&named),
                    short(&other_name),
                    name(tags::PATIENT_ID)
                ));
            }
            if one.patient_id != other.patient_id {
                notes.push(self.missing(tags::PATIENT_ID, one.patient_id.is_empty(), "patient"));
            }
        } else if differ(&named, &other_name) {
            notes.push(format!(
                "{} is \"{}\", and \"{}\" in {file}; the {} is the same",
                name(tags::PATIENT_NAME),
                short(&named),
                short(&other_name),
                name(tags::PATIENT_ID)
            ));
        }
        for (tag, a, b) in [
            (tags::PATIENT_BIRTH_DATE, &one.birth_date, &other.birth_date),
            (tags::PATIENT_SEX, &one.sex, &other.sex),
        ] {
            if differ(a, b) {
                notes.push(format!("{} is {}, and {} in {file}", name(tag), short(a), short(b)));
            }
        }
        Ok(notes)
    }

    fn frame(&self) -> Result<Vec<String>, String> {
        let (one, other, file) = (self.identity, self.other, &self.other_file);
        let (frame, other_frame) = (&one.frame_of_reference, &other.frame_of_reference);
        let mut notes = Vec::new();
        match (frame.is_empty(), other_frame.is_empty()) {
            (false, false) if frame != other_frame => {
                return Err(format!(
                    "its frame of reference is {} and not {} as that of {file}, so its places mean something else; \
                     give files of one frame of reference",
                    short(frame),
                    short(other_frame)
                ));
            }
            (is_missing, is_missing_there) if is_missing != is_missing_there => {
                notes.push(self.missing(tags::FRAME_OF_REFERENCE_UID, is_missing, "frame of reference"));
            }
            _ => {}
        }
        if !one.study.is_empty() && !other.study.is_empty() && one.study != other.study {
            notes.push(format!(
                "it is of another study than {file} ({})",
                name(tags::STUDY_INSTANCE_UID)
            ));
        }
        Ok(notes)
    }

    fn missing(&self, tag: Tag, here: bool, what: &str) -> String {
        let file = if here { "it" } else { &self.other_file };
        format!("{} is missing in {file}, so the {what} is not compared", name(tag))
    }
}

/// Returns the letters of a name in one form: programs differ in case, in empty parts, and in
/// further spellings after an equals sign.
fn family(name: &str) -> String {
    let first = name.split('=').find(|part| !part.trim_matches(['^', ' ']).is_empty());
    let parts = first
        .unwrap_or_default()
        .split(['^', ' ', ','])
        .filter(|part| !part.is_empty());
    parts.map(str::to_uppercase).collect::<Vec<_>>().join("^")
}
