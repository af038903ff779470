//! Patient, study and frame of reference of a file, which travel with all that is read and written.

use super::checked::Object;
use super::values::{items, text};
use super::write::{new_uid, now};
use dicom_core::Tag;
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use std::ops::Range;

/// Most characters of a part; no DICOM value among them is longer.
const MOST: usize = 200;

/// Names of the parts in other formats, in the order of `fields`.
const NAMES: [&str; 12] = [
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

/// Their attributes, in the same order.
const TAGS: [Tag; 12] = [
    tags::PATIENT_NAME,
    tags::PATIENT_ID,
    tags::PATIENT_BIRTH_DATE,
    tags::PATIENT_SEX,
    tags::STUDY_INSTANCE_UID,
    tags::STUDY_DATE,
    tags::STUDY_TIME,
    tags::STUDY_ID,
    tags::ACCESSION_NUMBER,
    tags::REFERRING_PHYSICIAN_NAME,
    tags::FRAME_OF_REFERENCE_UID,
    tags::POSITION_REFERENCE_INDICATOR,
];

/// Places of the parts of a patient, a study and a frame among [`NAMES`].
const PATIENT: Range<usize> = 0..4;
const STUDY: Range<usize> = 4..10;
const FRAME: Range<usize> = 10..12;

/// Patient, study and frame of a file; a text is empty if the file omits it.
#[derive(Clone, Debug, Default, PartialEq)]
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
            study: new_uid(),
            study_date,
            study_time,
            frame_of_reference: new_uid(),
            ..Self::default()
        }
    }

    /// Returns the identity of a DICOM object.
    pub fn of(object: &Object) -> Self {
        let mut found = Self::default();
        for (field, tag) in found.fields().into_iter().zip(TAGS) {
            *field = text(&object.data, tag).unwrap_or_default();
        }
        found.frame_of_reference = frame_of_reference(&object.data).unwrap_or_default();
        found
    }

    /// Returns the identity with a new study and a new frame where it has none, to write DICOM.
    #[must_use]
    pub fn completed(mut self) -> Self {
        for uid in [&mut self.study, &mut self.frame_of_reference] {
            if uid.is_empty() {
                *uid = new_uid();
            }
        }
        self
    }

    /// Returns the identity with patient, study or frame of another one where it has none itself.
    #[must_use]
    pub(super) fn filled(mut self, mut other: Self) -> Self {
        let mut of_other = other.fields();
        for (of, lacks) in [
            (PATIENT, self.patient_id.is_empty() && self.patient_name.is_empty()),
            (STUDY, self.study.is_empty()),
            (FRAME, self.frame_of_reference.is_empty()),
        ] {
            let own = self.fields();
            let parts = own.into_iter().zip(&mut of_other).enumerate();
            parts
                .filter(|(n, _)| lacks && of.contains(n))
                .for_each(|(_, (own, other))| std::mem::swap(own, *other));
        }
        self
    }

    /// Returns all attributes with their texts.
    pub(super) fn attributes(&self) -> Vec<(Tag, String)> {
        let mut copy = self.clone();
        TAGS.into_iter().zip(copy.fields().map(std::mem::take)).collect()
    }

    /// Returns each part that is not empty, with its name in other formats.
    pub fn parts(&self) -> Vec<(&'static str, String)> {
        let mut copy = self.clone();
        let all = NAMES.into_iter().zip(copy.fields());
        let filled = all.filter(|(_, field)| !field.is_empty());
        filled.map(|(name, field)| (name, printed(field))).collect()
    }

    /// Creates an identity from its parts by their names; `None` if there is none.
    pub(crate) fn of_parts<'a>(part: impl Fn(&str) -> Option<&'a str>) -> Option<Self> {
        let mut found = Self::default();
        for (name, field) in NAMES.into_iter().zip(found.fields()) {
            *field = printed(part(name).unwrap_or_default());
        }
        let is_uid = |uid: &str| uid.chars().all(|c| c.is_ascii_digit() || c == '.');
        for uid in [&mut found.study, &mut found.frame_of_reference] {
            if !is_uid(uid) {
                uid.clear();
            }
        }
        (!found.parts().is_empty()).then_some(found)
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
}

fn printed(part: &str) -> String {
    part.chars().filter(|c| !c.is_control()).take(MOST).collect()
}

/// Returns the frame of reference. A structure set names it with its structures, or only in the
/// sequence of frames.
fn frame_of_reference(data: &InMemDicomObject) -> Option<String> {
    let first = |sequence, tag| items(data, sequence).iter().find_map(|item| text(item, tag));
    text(data, tags::FRAME_OF_REFERENCE_UID)
        .or_else(|| {
            first(
                tags::STRUCTURE_SET_ROI_SEQUENCE,
                tags::REFERENCED_FRAME_OF_REFERENCE_UID,
            )
        })
        .or_else(|| {
            first(
                tags::REFERENCED_FRAME_OF_REFERENCE_SEQUENCE,
                tags::FRAME_OF_REFERENCE_UID,
            )
        })
}
