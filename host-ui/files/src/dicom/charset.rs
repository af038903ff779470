//! Text by the character sets that a file declares (PS3.5, 6.1), with ISO 2022 escapes between
//! them. Text that they do not give is refused with the name of its element.

use super::super::element::short;
use super::values::name;
use crate::error::{ContentError, invalid};
use dicom_core::header::Header;
use dicom_core::value::{InMemFragment, PrimitiveValue, Value};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use encoding_rs::{self as encoding, Encoding};

/// Elements with text of people that are used or written again.
const TEXTS: [Tag; 22] = [
    tags::PATIENT_NAME,
    tags::PATIENT_ID,
    tags::ACCESSION_NUMBER,
    tags::STUDY_ID,
    tags::REFERRING_PHYSICIAN_NAME,
    tags::SERIES_DESCRIPTION,
    tags::POSITION_REFERENCE_INDICATOR,
    tags::ROI_NAME,
    tags::RT_PLAN_LABEL,
    tags::RT_PLAN_NAME,
    tags::STRUCTURE_SET_LABEL,
    tags::SOURCE_DESCRIPTION,
    tags::SOURCE_MODEL_ID,
    tags::SOURCE_MANUFACTURER,
    tags::SOURCE_ISOTOPE_NAME,
    tags::SOURCE_APPLICATOR_ID,
    tags::MANUFACTURER,
    tags::MANUFACTURER_MODEL_NAME,
    tags::PATIENT_COMMENTS,
    tags::DOSE_COMMENT,
    tags::DOSE_REFERENCE_DESCRIPTION,
    tags::CODE_MEANING,
];

/// Character set of the upper half of the bytes.
#[derive(Clone, Copy)]
pub enum Upper {
    None,
    Latin1,
    One(&'static Encoding),
    /// Two bytes a character.
    Two(&'static Encoding),
}

/// Character set of the lower half of the bytes.
#[derive(Clone, Copy, PartialEq)]
enum Lower {
    Ascii,
    Jis208,
    Jis212,
}

/// Character sets in force.
#[derive(Clone)]
pub enum Sets {
    /// One without escapes, for all bytes.
    Whole(&'static Encoding),
    /// Sets that escapes change; the initial one of the upper half.
    Changing(Upper),
    /// A term that is not known here.
    Unknown(String),
}

impl Sets {
    /// Returns the sets of a file that declares none.
    pub fn none() -> Self {
        Self::Changing(Upper::None)
    }

    /// Returns the sets of the terms of an element, separated by backslashes.
    fn of(terms: &str) -> Self {
        let mut initial = None;
        for term in terms.split('\\') {
            let term: String = term.trim_matches(['\0', ' ']).to_ascii_uppercase();
            let words: Vec<&str> = term.split([' ', '_', '-']).filter(|word| !word.is_empty()).collect();
            let set = match words.as_slice() {
                ["ISO", "IR", "192"] => return Self::Whole(encoding::UTF_8),
                ["GB18030"] => return Self::Whole(encoding::GB18030),
                ["GBK"] => return Self::Whole(encoding::GBK),
                [] | ["ISO", "IR" | "2022", "6"] | ["ISO", "2022", "IR", "6" | "87" | "159"] | ["ISO", "IR", "87"] => {
                    Upper::None
                }
                ["ISO", "IR", number] | ["ISO", "2022", "IR", number] => match of_number(number) {
                    Some(set) => set,
                    None => return Self::Unknown(term),
                },
                _ => return Self::Unknown(term),
            };
            initial.get_or_insert(set);
        }
        Self::Changing(initial.unwrap_or(Upper::None))
    }
}

/// Sets of the upper half: their number in ISO_IR, their escape, and their decoder. The letters of 148 and 1254 are the
/// same from A0 on.
const UPPER: [(&str, &[u8], Upper); 14] = [
    ("13", b")I", Upper::One(encoding::SHIFT_JIS)),
    ("58", b"$)A", Upper::Two(encoding::GBK)),
    ("100", b"-A", Upper::Latin1),
    ("101", b"-B", Upper::One(encoding::ISO_8859_2)),
    ("109", b"-C", Upper::One(encoding::ISO_8859_3)),
    ("110", b"-D", Upper::One(encoding::ISO_8859_4)),
    ("126", b"-F", Upper::One(encoding::ISO_8859_7)),
    ("127", b"-G", Upper::One(encoding::ISO_8859_6)),
    ("138", b"-H", Upper::One(encoding::ISO_8859_8)),
    ("144", b"-L", Upper::One(encoding::ISO_8859_5)),
    ("148", b"-M", Upper::One(encoding::WINDOWS_1254)),
    ("149", b"$)C", Upper::Two(encoding::EUC_KR)),
    ("166", b"-T", Upper::One(encoding::WINDOWS_874)),
    ("203", b"-b", Upper::One(encoding::ISO_8859_15)),
];
const LOWER: [(&[u8], Lower); 5] = [
    (b"(B", Lower::Ascii),
    (b"(J", Lower::Ascii),
    (b"$B", Lower::Jis208),
    (b"$@", Lower::Jis208),
    (b"$(D", Lower::Jis212),
];

fn of_number(number: &str) -> Option<Upper> {
    UPPER.iter().find(|(of, ..)| *of == number).map(|(.., set)| *set)
}

/// Returns the lower or the upper set after an escape, and the length of the escape.
fn escape(rest: &[u8]) -> Option<(Result<Lower, Upper>, usize)> {
    let lower = LOWER.iter().map(|(escape, set)| (*escape, Ok(*set)));
    let mut all = lower.chain(UPPER.iter().map(|(_, escape, set)| (*escape, Err(*set))));
    let (escape, set) = all.find(|(escape, _)| rest.starts_with(escape))?;
    Some((set, escape.len()))
}

/// Decodes one element; `None` if its bytes are not of the sets. At a delimiter the initial set is
/// in force again; those of a name are `^` and `=`.
fn decoded(bytes: &[u8], sets: &Sets, is_name: bool) -> Option<String> {
    if bytes.iter().all(|b| b.is_ascii() && *b != 0x1b) {
        return Some(bytes.iter().map(|&b| b as char).collect());
    }
    let initial = match sets {
        Sets::Whole(set) => return strictly(set, bytes),
        Sets::Unknown(_) => return None,
        Sets::Changing(initial) => *initial,
    };
    let (mut lower, mut upper) = (Lower::Ascii, initial);
    let (mut text, mut at) = (String::new(), 0);
    while let Some(&byte) = bytes.get(at) {
        let next = bytes.get(at + 1).copied();
        if byte == 0x1b {
            let (set, length) = escape(&bytes[at + 1..])?;
            match set {
                Ok(set) => lower = set,
                Err(set) => upper = set,
            }
            at += 1 + length;
            continue;
        }
        let (one, length) = match (byte, lower, upper) {
            (0x21..=0x7e, Lower::Jis208, _) => (strictly(encoding::EUC_JP, &[byte | 0x80, next? | 0x80])?, 2),
            (0x21..=0x7e, Lower::Jis212, _) => (strictly(encoding::EUC_JP, &[0x8f, byte | 0x80, next? | 0x80])?, 2),
            (0..=0x7f, ..) => {
                if matches!(byte, b'\\' | b'\t' | b'\n' | b'\r' | 0x0c) || is_name && matches!(byte, b'^' | b'=') {
                    (lower, upper) = (Lower::Ascii, initial);
                }
                (char::from(byte).to_string(), 1)
            }
            (0xa0.., _, Upper::Latin1) => (char::from(byte).to_string(), 1),
            (0xa0.., _, Upper::One(set)) => (strictly(set, &[byte])?, 1),
            (0xa1.., _, Upper::Two(set)) => (strictly(set, &[byte, next.filter(|b| *b >= 0xa1)?])?, 2),
            _ => return None,
        };
        text += &one;
        at += length;
    }
    Some(text)
}

fn strictly(set: &'static Encoding, bytes: &[u8]) -> Option<String> {
    let text = set.decode_without_bom_handling_and_without_replacement(bytes)?;
    Some(text.into_owned())
}

/// Decodes the texts of an object that was parsed byte by byte as Latin-1, with its declared sets
/// in the element `declared`; sequences have the sets of their object unless they declare others.
pub fn decode(object: &mut InMemDicomObject, declared: Tag, inherited: &Sets) -> Result<(), ContentError> {
    let own = object.get(declared).and_then(|element| raw(element.value()));
    let sets = own.map_or_else(|| inherited.clone(), |bytes| Sets::of(&String::from_utf8_lossy(&bytes)));
    let elements: Vec<(Tag, VR)> = object.iter().map(|element| (element.tag(), element.vr())).collect();
    for (tag, vr) in elements {
        let mut outcome = Ok(());
        if TEXTS.contains(&tag) {
            object.update_value(tag, |value| outcome = decode_value(value, tag, vr, &sets));
        } else if vr == VR::SQ && tag != tags::ROI_CONTOUR_SEQUENCE {
            object.update_value(tag, |value| {
                let mut items = value.items_mut().into_iter().flatten();
                outcome = items.try_for_each(|item| decode(item, declared, &sets));
            });
        }
        outcome?;
    }
    Ok(())
}

fn decode_value(
    value: &mut Value<InMemDicomObject, InMemFragment>,
    tag: Tag,
    vr: VR,
    sets: &Sets,
) -> Result<(), ContentError> {
    let Some(bytes) = raw(value) else { return Ok(()) };
    let is_name = vr == VR::PN || [tags::PATIENT_NAME, tags::REFERRING_PHYSICIAN_NAME].contains(&tag);
    let Some(text) = decoded(&bytes, sets, is_name) else {
        let set = match sets {
            Sets::Unknown(term) => format!(
                "{} {}, which is not known",
                name(tags::SPECIFIC_CHARACTER_SET),
                short(term)
            ),
            _ => name(tags::SPECIFIC_CHARACTER_SET),
        };
        return Err(invalid!(
            "{} has letters that are not of {set}; export it again with the character set of its names",
            name(tag)
        ));
    };
    *value = PrimitiveValue::Str(text).into();
    Ok(())
}

/// Returns the bytes of a text that was parsed as Latin-1.
fn raw(value: &Value<InMemDicomObject, InMemFragment>) -> Option<Vec<u8>> {
    let latin1 = |text: &str| {
        text.chars()
            .map(|c| u8::try_from(c).unwrap_or(b'?'))
            .collect::<Vec<u8>>()
    };
    match value.primitive()? {
        PrimitiveValue::Str(text) => Some(latin1(text)),
        PrimitiveValue::Strs(texts) => Some(latin1(&texts.join("\\"))),
        PrimitiveValue::U8(bytes) => Some(bytes.to_vec()),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
