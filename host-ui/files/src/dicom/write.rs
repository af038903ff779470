//! Common parts of all DICOM files written here: author, time, and unique identifiers.

use super::Identity;
use crate::error::ContentError;
use dicom_core::value::{DataSetSequence, PrimitiveValue};
use dicom_core::{DataElement, Length, Tag, VR};
use dicom_dictionary_std::{tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use std::hash::{BuildHasher, Hasher, RandomState};

/// Identifier of the program in its files; under 2.25 because it has no root of its own.
const IMPLEMENTATION: &str = "2.25.302416733929811471066208173541526011461";

/// Returns 128 random bits under 2.25, the standard's prefix for writers without a root.
pub fn new_uid() -> String {
    let random = || u128::from(RandomState::new().build_hasher().finish());
    format!("2.25.{}", (random() << 64 | random()).max(1))
}

pub fn string(tag: Tag, vr: VR, value: &str) -> DataElement<InMemDicomObject> {
    DataElement::new(tag, vr, PrimitiveValue::from(value))
}

/// Writes numbers as text, within the 16 characters available.
pub fn decimals(tag: Tag, values: &[f64]) -> DataElement<InMemDicomObject> {
    let texts: Vec<String> = values.iter().map(|&v| decimal(v)).collect();
    DataElement::new(tag, VR::DS, PrimitiveValue::Strs(texts.into()))
}

fn decimal(value: f64) -> String {
    let exact = format!("{value}");
    if exact.len() <= 16 {
        return exact;
    }
    // The nearest that sixteen characters allow, with an exponent or without.
    (0..=15)
        .flat_map(|digits| [format!("{value:.digits$}"), format!("{value:.digits$e}")])
        .filter(|text| text.len() <= 16)
        .min_by(|a, b| {
            let off = |text: &str| text.parse::<f64>().map_or(f64::INFINITY, |v| (v - value).abs());
            off(a).total_cmp(&off(b))
        })
        .unwrap_or_else(|| format!("{value:.8e}"))
}

/// Returns one item that refers to another object by its class and its UID.
pub fn reference(sop_class: &str, uid: &str) -> InMemDicomObject {
    item([
        string(tags::REFERENCED_SOP_CLASS_UID, VR::UI, sop_class),
        string(tags::REFERENCED_SOP_INSTANCE_UID, VR::UI, uid),
    ])
}

pub fn whole(tag: Tag, value: usize) -> DataElement<InMemDicomObject> {
    string(tag, VR::IS, &value.to_string())
}

pub fn sequence(tag: Tag, items: Vec<InMemDicomObject>) -> DataElement<InMemDicomObject> {
    DataElement::new(tag, VR::SQ, DataSetSequence::new(items, Length::UNDEFINED))
}

pub fn item(elements: impl IntoIterator<Item = DataElement<InMemDicomObject>>) -> InMemDicomObject {
    InMemDicomObject::from_element_iter(elements)
}

/// Returns the modules of patient, study, series, frame and equipment.
pub fn common(sop_class: &str, modality: &str, of: &Identity) -> InMemDicomObject {
    let (date, time) = now();
    item([
        string(tags::SPECIFIC_CHARACTER_SET, VR::CS, "ISO_IR 192"),
        string(tags::SOP_CLASS_UID, VR::UI, sop_class),
        string(tags::SOP_INSTANCE_UID, VR::UI, &new_uid()),
        string(tags::STUDY_DATE, VR::DA, &of.study_date),
        string(tags::STUDY_TIME, VR::TM, &of.study_time),
        string(tags::INSTANCE_CREATION_DATE, VR::DA, &date),
        string(tags::INSTANCE_CREATION_TIME, VR::TM, &time),
        string(tags::ACCESSION_NUMBER, VR::SH, &of.accession_number),
        string(tags::MODALITY, VR::CS, modality),
        string(tags::MANUFACTURER, VR::LO, "Stylet"),
        string(
            tags::MANUFACTURER_MODEL_NAME,
            VR::LO,
            "Stylet simulator, not for treatment",
        ),
        string(tags::SOFTWARE_VERSIONS, VR::LO, env!("CARGO_PKG_VERSION")),
        string(tags::REFERRING_PHYSICIAN_NAME, VR::PN, &of.referring_physician),
        string(tags::OPERATORS_NAME, VR::PN, ""),
        string(tags::PATIENT_NAME, VR::PN, &of.patient_name),
        string(tags::PATIENT_ID, VR::LO, &of.patient_id),
        string(tags::PATIENT_BIRTH_DATE, VR::DA, &of.birth_date),
        string(tags::PATIENT_SEX, VR::CS, &of.sex),
        string(tags::STUDY_INSTANCE_UID, VR::UI, &of.study),
        string(tags::SERIES_INSTANCE_UID, VR::UI, &new_uid()),
        string(tags::STUDY_ID, VR::SH, &of.study_id),
        string(tags::SERIES_NUMBER, VR::IS, "1"),
        string(tags::FRAME_OF_REFERENCE_UID, VR::UI, &of.frame_of_reference),
        string(tags::POSITION_REFERENCE_INDICATOR, VR::LO, &of.position_reference),
    ])
}

/// Returns date and time of UTC in DICOM format.
pub fn now() -> (String, String) {
    let now = jiff::Timestamp::now();
    let of = |format: &str| now.strftime(format).to_string();
    (of("%Y%m%d"), of("%H%M%S"))
}

/// Returns the bytes of the file, each element with its kind.
pub fn bytes(object: InMemDicomObject) -> Result<Vec<u8>, ContentError> {
    bytes_in(uids::EXPLICIT_VR_LITTLE_ENDIAN, object)
}

/// Like [`bytes`], without the kinds: lists of numbers may then be longer than 64 KiB.
pub fn implicit_bytes(object: InMemDicomObject) -> Result<Vec<u8>, ContentError> {
    bytes_in(uids::IMPLICIT_VR_LITTLE_ENDIAN, object)
}

fn bytes_in(syntax: &str, object: InMemDicomObject) -> Result<Vec<u8>, ContentError> {
    let meta = FileMetaTableBuilder::new()
        .transfer_syntax(syntax)
        .implementation_class_uid(IMPLEMENTATION)
        .implementation_version_name("STYLET");
    let file = object
        .with_meta(meta)
        .map_err(|e| format!("it cannot be written ({e})"))?;
    let mut bytes = Vec::new();
    file.write_all(&mut bytes)
        .map_err(|e| format!("it cannot be written ({e})"))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::decimal;

    /// Guards against small numbers that lost most of their digits to leading zeros.
    #[test]
    fn sixteen_characters_keep_as_many_digits_as_they_can() {
        for (value, relative) in [
            (8.876_543_210_123e-9, 1e-10),
            (-1.234_567_890_123_456e-12, 1e-8),
            (-123.456_789_012_345_67, 1e-13),
            (0.1 + 0.2, 1e-14),
            (6_405_120.123_456_789, 1e-14),
        ] {
            let text = decimal(value);
            let read: f64 = text.parse().unwrap();
            assert!(text.len() <= 16, "{text}");
            assert!(((read - value) / value).abs() < relative, "{text} for {value:e}");
        }
        assert_eq!(decimal(145.0), "145");
    }
}
