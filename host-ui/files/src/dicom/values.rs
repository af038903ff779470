//! Values out of a DICOM object, as text and numbers that can be trusted.

use super::super::element::short;
use dicom_core::Tag;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::value::{PrimitiveValue, Value};
use dicom_dictionary_std::StandardDataDictionary;
use dicom_object::InMemDicomObject;

/// As the standard calls it, with its number.
pub fn name(tag: Tag) -> String {
    let alias = StandardDataDictionary.by_tag(tag).map_or("element", |e| e.alias());
    format!("{alias} {tag}")
}

/// `None` where it is absent or empty.
pub fn text(object: &InMemDicomObject, tag: Tag) -> Option<String> {
    let element = object.get(tag)?;
    let value = match element.value() {
        // Of a kind that the writer did not know.
        Value::Primitive(PrimitiveValue::U8(bytes)) => String::from_utf8_lossy(bytes).into_owned(),
        _ => element.to_str().ok()?.into_owned(),
    };
    let value = value.trim_matches(['\0', ' ']);
    (!value.is_empty()).then(|| value.to_owned())
}

pub fn items(object: &InMemDicomObject, tag: Tag) -> &[InMemDicomObject] {
    object.get(tag).and_then(|e| e.items()).unwrap_or_default()
}

/// All finite; `None` where it is absent or empty.
pub fn numbers(object: &InMemDicomObject, tag: Tag) -> Result<Option<Vec<f64>>, String> {
    let (Some(element), Some(shown)) = (object.get(tag), text(object, tag)) else {
        return Ok(None);
    };
    let wrong = || format!("{} is \"{}\", which is no list of numbers", name(tag), short(&shown));
    let values = element.to_multi_float64().map_err(|_| wrong())?;
    if values.iter().all(|v| v.is_finite()) {
        return Ok(Some(values));
    }
    Err(wrong())
}

pub fn exactly<const N: usize>(object: &InMemDicomObject, tag: Tag) -> Result<Option<[f64; N]>, String> {
    let Some(values) = numbers(object, tag)? else {
        return Ok(None);
    };
    let count = values.len();
    let values = <[f64; N]>::try_from(values);
    values
        .map(Some)
        .map_err(|_| format!("{} has {count} values; it must have {N}", name(tag)))
}

pub fn number(object: &InMemDicomObject, tag: Tag) -> Result<Option<f64>, String> {
    Ok(exactly::<1>(object, tag)?.map(|[v]| v))
}

/// A number that there must be, within limits.
pub fn needed(object: &InMemDicomObject, tag: Tag, least: f64, most: f64) -> Result<f64, String> {
    match number(object, tag)? {
        Some(v) if (least..=most).contains(&v) => Ok(v),
        Some(v) => Err(format!("{} is {v}; allowed are {least} to {most}", name(tag))),
        None => Err(format!("{} is missing", name(tag))),
    }
}
