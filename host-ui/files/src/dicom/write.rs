//! Common parts of all DICOM files written here: author, time, and unique identifiers.

use super::Identity;
use crate::error::ContentError;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::value::{DataSetSequence, PrimitiveValue};
use dicom_core::{DataElement, Length, Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use std::hash::{BuildHasher, Hasher, RandomState};

/// Identifier of the program in its files; under 2.25 because it has no root of its own.
const IMPLEMENTATION: &str = "2.25.302416733929811471066208173541526011461";

/// Returns 128 random bits under 2.25, the standard's prefix for writers without a root.
pub fn new_uid() -> String {
    let random = || u128::from(RandomState::new().build_hasher().finish());
    format!("2.25.{}", (random() << 64 | random()).max(1))
}

/// Returns a text of the kind that the standard gives its tag, cut to the length of that kind.
pub fn string(tag: Tag, value: &str) -> DataElement<InMemDicomObject> {
    let most = match kind(tag) {
        VR::SH => 16,
        VR::LO => 64,
        _ => usize::MAX,
    };
    whole_string(tag, &value.chars().take(most).collect::<String>())
}

/// Like [`string`], of any length.
fn whole_string(tag: Tag, value: &str) -> DataElement<InMemDicomObject> {
    DataElement::new(tag, kind(tag), PrimitiveValue::from(value))
}

fn kind(tag: Tag) -> VR {
    let known = StandardDataDictionary.by_tag(tag);
    known.map_or(VR::UN, |entry| entry.vr().relaxed())
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
        string(tags::REFERENCED_SOP_CLASS_UID, sop_class),
        string(tags::REFERENCED_SOP_INSTANCE_UID, uid),
    ])
}

pub fn whole(tag: Tag, value: usize) -> DataElement<InMemDicomObject> {
    string(tag, &value.to_string())
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
    let mut object = item([
        string(tags::SPECIFIC_CHARACTER_SET, "ISO_IR 192"),
        string(tags::SOP_CLASS_UID, sop_class),
        string(tags::SOP_INSTANCE_UID, &new_uid()),
        string(tags::INSTANCE_CREATION_DATE, &date),
        string(tags::INSTANCE_CREATION_TIME, &time),
        string(tags::MODALITY, modality),
        string(tags::MANUFACTURER, "Stylet"),
        string(tags::MANUFACTURER_MODEL_NAME, "Stylet simulator, not for treatment"),
        string(tags::SOFTWARE_VERSIONS, env!("CARGO_PKG_VERSION")),
        string(tags::OPERATORS_NAME, ""),
        string(tags::SERIES_INSTANCE_UID, &new_uid()),
        string(tags::SERIES_NUMBER, "1"),
    ]);
    for (tag, value) in of.attributes() {
        object.put(whole_string(tag, &value));
    }
    object
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
