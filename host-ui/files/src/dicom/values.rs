//! Values from a DICOM object, as checked text and numbers.

use super::super::element::short;
use crate::error::{ContentError, invalid};
use dicom_core::Tag;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::value::{PrimitiveValue, Value};
use dicom_dictionary_std::StandardDataDictionary;
use dicom_object::InMemDicomObject;

/// Returns the standard's name of a tag, with its number.
pub fn name(tag: Tag) -> String {
    let alias = StandardDataDictionary.by_tag(tag).map_or("element", |e| e.alias());
    format!("{alias} {tag}")
}

/// Returns a text without control characters, which a terminal would execute; `None` if it is
/// absent or empty.
pub fn text(object: &InMemDicomObject, tag: Tag) -> Option<String> {
    let element = object.get(tag)?;
    let value = match element.value() {
        // Of a kind that the writer did not know.
        Value::Primitive(PrimitiveValue::U8(bytes)) => String::from_utf8_lossy(bytes).into_owned(),
        _ => element.to_str().ok()?.into_owned(),
    };
    let shown: String = value.chars().filter(|c| !c.is_control()).collect();
    // One value that is there several times is one value.
    let mut parts = shown.split('\\').map(|part| part.trim_matches(' '));
    let first = parts.next().unwrap_or_default();
    let is_one = parts.all(|part| part == first);
    let shown = if is_one { first } else { shown.trim_matches(' ') };
    (!shown.is_empty()).then(|| shown.to_owned())
}

pub fn items(object: &InMemDicomObject, tag: Tag) -> &[InMemDicomObject] {
    object.get(tag).and_then(|e| e.items()).unwrap_or_default()
}

/// Returns finite numbers; `None` if they are absent or empty.
pub fn numbers(object: &InMemDicomObject, tag: Tag) -> Result<Option<Vec<f64>>, ContentError> {
    let (Some(element), Some(shown)) = (object.get(tag), text(object, tag)) else {
        return Ok(None);
    };
    let wrong = || {
        let shown = short(&shown);
        invalid!("{} is \"{shown}\", which is not a list of numbers", name(tag))
    };
    let values = element.to_multi_float64().map_err(|_| wrong())?;
    if values.iter().all(|v| v.is_finite()) {
        return Ok(Some(values));
    }
    Err(wrong())
}

pub fn exactly<const N: usize>(object: &InMemDicomObject, tag: Tag) -> Result<Option<[f64; N]>, ContentError> {
    let Some(values) = numbers(object, tag)? else {
        return Ok(None);
    };
    let count = values.len();
    let values = <[f64; N]>::try_from(values);
    values
        .map(Some)
        .map_err(|_| format!("{} has {count} values; it must have {N}", name(tag)).into())
}

/// Returns mandatory numbers.
pub fn given<const N: usize>(object: &InMemDicomObject, tag: Tag) -> Result<[f64; N], ContentError> {
    exactly(object, tag)?.ok_or_else(|| format!("{} is missing", name(tag)).into())
}

pub fn number(object: &InMemDicomObject, tag: Tag) -> Result<Option<f64>, ContentError> {
    Ok(exactly::<1>(object, tag)?.map(|[v]| v))
}

/// Returns a mandatory number within limits.
pub fn needed(object: &InMemDicomObject, tag: Tag, least: f64, most: f64) -> Result<f64, ContentError> {
    let [v] = given(object, tag)?;
    match (least..=most).contains(&v) {
        true => Ok(v),
        false => Err(invalid!("{} is {v}; allowed are {least} to {most}", name(tag))),
    }
}
