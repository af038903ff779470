//! Patient, study and frame of reference of a file.

use super::super::element::short;
use super::checked::{self, Object};
use super::values::{items, text};
use super::write::{new_uid, now};
use crate::error::FileError;
use crate::progress::Progress;
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use std::path::Path;

/// Number of bytes that identify a DICOM file.
const START_BYTES: u64 = 160;

/// Names of the parts in a table, in the order of `fields`.
pub const COLUMNS: [&str; 12] = [
    "dicom_patient_name",
    "dicom_patient_id",
    "dicom_birth_date",
    "dicom_sex",
    "dicom_study",
    "dicom_study_date",
    "dicom_study_time",
    "dicom_study_id",
    "dicom_accession_number",
    "dicom_referring_physician",
    "dicom_frame_of_reference",
    "dicom_position_reference",
];

/// Patient, study and frame of a file; a text is empty if the file omits it.
#[derive(Clone, Debug, PartialEq)]
pub struct Identity {
    /// Name of the patient.
    pub patient_name: String,
    /// Identifier of the patient.
    pub patient_id: String,
    /// Day of birth, in DICOM format.
    pub birth_date: String,
    /// Sex: M, F or O.
    pub sex: String,
    /// Study instance UID.
    pub study: String,
    /// Day of the study, in DICOM format.
    pub study_date: String,
    /// Time of the study, in DICOM format.
    pub study_time: String,
    /// Identifier of the study.
    pub study_id: String,
    /// Number of the order.
    pub accession_number: String,
    /// Name of the referring physician.
    pub referring_physician: String,
    /// Frame of reference UID.
    pub frame_of_reference: String,
    /// Position reference of the frame.
    pub position_reference: String,
}

impl Identity {
    /// Creates an anonymous identity, in a new study and frame.
    pub fn new() -> Self {
        let (study_date, study_time) = now();
        Self {
            patient_name: "Stylet^Simulation".to_owned(),
            patient_id: "STYLET".to_owned(),
            birth_date: String::new(),
            sex: String::new(),
            study: new_uid(),
            study_date,
            study_time,
            study_id: String::new(),
            accession_number: String::new(),
            referring_physician: String::new(),
            frame_of_reference: new_uid(),
            position_reference: String::new(),
        }
    }

    /// Returns the identity of a DICOM object; creates study and frame if it has none.
    pub fn of(object: &Object) -> Self {
        let data = &object.data;
        let of = |tag| text(data, tag).unwrap_or_default();
        Self {
            patient_name: of(tags::PATIENT_NAME),
            patient_id: of(tags::PATIENT_ID),
            birth_date: of(tags::PATIENT_BIRTH_DATE),
            sex: of(tags::PATIENT_SEX),
            study: text(data, tags::STUDY_INSTANCE_UID).unwrap_or_else(new_uid),
            study_date: of(tags::STUDY_DATE),
            study_time: of(tags::STUDY_TIME),
            study_id: of(tags::STUDY_ID),
            accession_number: of(tags::ACCESSION_NUMBER),
            referring_physician: of(tags::REFERRING_PHYSICIAN_NAME),
            frame_of_reference: frame_of_reference(data).unwrap_or_else(new_uid),
            position_reference: of(tags::POSITION_REFERENCE_INDICATOR),
        }
    }

    /// Returns the identity of the file at `path`; `None` for a file that is not DICOM.
    pub fn of_file(path: &Path) -> Result<Option<Self>, FileError> {
        let refused = |why| FileError::of(path, why);
        if !crate::bytes::start(path, START_BYTES).is_some_and(|start| checked::is_dicom(&start)) {
            return Ok(None);
        }
        let bytes = crate::bytes::whole(path, &Progress::default()).map_err(refused)?;
        let object = checked::read(&bytes).map_err(refused)?;
        Ok(Some(Self::of(&object)))
    }

    /// Returns the parts as columns of a table for [`Identity::of_columns`], without empty ones.
    pub fn to_columns(&self) -> Vec<(&'static str, String)> {
        let mut copy = self.clone();
        let columns = COLUMNS.into_iter().zip(copy.fields());
        let filled = columns.filter(|(_, field)| !field.is_empty());
        filled.map(|(column, field)| (column, field.clone())).collect()
    }

    /// Reads the identity from one row of a table; `None` if it names no study and no frame.
    pub fn of_columns<'a>(value: impl Fn(&str) -> Option<&'a str>) -> Option<Self> {
        let mut found = Self::new();
        for (column, field) in COLUMNS.into_iter().zip(found.fields()) {
            // No DICOM value among these is longer.
            let text = value(column).unwrap_or_default().chars();
            *field = text.filter(|c| !c.is_control()).take(64).collect();
        }
        let is_uid = |uid: &str| !uid.is_empty() && uid.chars().all(|c| c.is_ascii_digit() || c == '.');
        (is_uid(&found.study) && is_uid(&found.frame_of_reference)).then_some(found)
    }

    fn fields(&mut self) -> [&mut String; 12] {
        [
            &mut self.patient_name,
            &mut self.patient_id,
            &mut self.birth_date,
            &mut self.sex,
            &mut self.study,
            &mut self.study_date,
            &mut self.study_time,
            &mut self.study_id,
            &mut self.accession_number,
            &mut self.referring_physician,
            &mut self.frame_of_reference,
            &mut self.position_reference,
        ]
    }

    /// Returns the reason why files of both cannot be parts of one study: another patient, or
    /// another frame.
    pub fn differs_from(&self, other: &Self) -> Option<String> {
        if self.patient_id != other.patient_id {
            let (one, two) = (short(&self.patient_id), short(&other.patient_id));
            return Some(format!("it is of patient \"{one}\" and not of \"{two}\""));
        }
        (self.frame_of_reference != other.frame_of_reference).then(|| {
            format!(
                "its frame of reference is {} and not {}, so its places mean something else",
                short(&self.frame_of_reference),
                short(&other.frame_of_reference)
            )
        })
    }
}

impl Default for Identity {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns the frame of reference. A structure set may name it only in the sequence of frames, or
/// with its structures.
fn frame_of_reference(data: &InMemDicomObject) -> Option<String> {
    let first = |sequence, tag| items(data, sequence).iter().find_map(|item| text(item, tag));
    text(data, tags::FRAME_OF_REFERENCE_UID)
        .or_else(|| {
            first(
                tags::REFERENCED_FRAME_OF_REFERENCE_SEQUENCE,
                tags::FRAME_OF_REFERENCE_UID,
            )
        })
        .or_else(|| {
            first(
                tags::STRUCTURE_SET_ROI_SEQUENCE,
                tags::REFERENCED_FRAME_OF_REFERENCE_UID,
            )
        })
}
