//! A walk through the elements of a data set, which checks lengths and depth.

use super::compressed::{Fragments, is_compressed};
use crate::error::{ContentError, invalid};
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags, uids};

/// Most sequences in each other.
pub const MAX_DEPTH: usize = 16;
const MAX_ELEMENTS: usize = 1 << 20;
/// Retired transfer syntax, still found in files.
const EXPLICIT_VR_BIG_ENDIAN: &str = "1.2.840.10008.1.2.2";
/// Value representations with a length of two bytes; all others have four.
const SHORT: &str = "AE AS AT CS DA DS DT FD FL IS LO LT PN SH SL SS ST TM UI UL US";
/// Length of an element that a delimiter ends.
pub const UNDEFINED: u32 = u32::MAX;
const ITEM: Tag = Tag(0xfffe, 0xe000);
const ITEM_END: Tag = Tag(0xfffe, 0xe00d);
const SEQUENCE_END: Tag = Tag(0xfffe, 0xe0dd);
/// First tag of pixels of any kind.
pub const FIRST_PIXELS: Tag = Tag(0x7fe0, 0x0008);

/// Encoding of a data set.
#[derive(Clone, Copy, PartialEq)]
pub enum Syntax {
    ExplicitLittle,
    ImplicitLittle,
    ExplicitBig,
}

impl Syntax {
    pub fn uid(self) -> &'static str {
        match self {
            Self::ExplicitLittle => uids::EXPLICIT_VR_LITTLE_ENDIAN,
            Self::ImplicitLittle => uids::IMPLICIT_VR_LITTLE_ENDIAN,
            Self::ExplicitBig => EXPLICIT_VR_BIG_ENDIAN,
        }
    }

    pub fn of(uid: &str) -> Result<Self, ContentError> {
        match uid {
            uids::IMPLICIT_VR_LITTLE_ENDIAN => Ok(Self::ImplicitLittle),
            uids::EXPLICIT_VR_LITTLE_ENDIAN => Ok(Self::ExplicitLittle),
            EXPLICIT_VR_BIG_ENDIAN => Ok(Self::ExplicitBig),
            // Compressed pixels: everything before them is encoded normally.
            packed if is_compressed(packed) => Ok(Self::ExplicitLittle),
            other => Err(invalid!(
                "its transfer syntax {} is not read; export it as explicit VR little endian",
                super::super::element::short(other)
            )),
        }
    }
}

/// Returns the bytes of one value of a binary kind.
fn size_of_number(vr: VR) -> u32 {
    match vr {
        VR::US | VR::SS | VR::OW => 2,
        VR::UL | VR::SL | VR::FL | VR::AT | VR::OF | VR::OL => 4,
        VR::FD | VR::SV | VR::UV | VR::OD | VR::OV => 8,
        _ => 1,
    }
}

/// Head of an element.
pub struct Head {
    pub tag: Tag,
    pub vr: VR,
    pub length: u32,
}

/// Place in a data set.
pub struct Walk<'a> {
    bytes: &'a [u8],
    pub at: usize,
    pub syntax: Syntax,
    elements: usize,
    /// Places of the elements that declare character sets.
    pub charsets: Vec<usize>,
}

impl<'a> Walk<'a> {
    /// Begins at byte `at`.
    pub fn new(bytes: &'a [u8], at: usize, syntax: Syntax) -> Self {
        Self {
            bytes,
            at,
            syntax,
            elements: 0,
            charsets: Vec::new(),
        }
    }

    /// Walks through the data set; returns its end, or the start of its pixels or of `last`.
    pub fn top(&mut self, last: Tag) -> Result<usize, ContentError> {
        while self.at < self.bytes.len() {
            let begin = self.at;
            let head = self.head()?;
            if head.tag == last || head.tag >= FIRST_PIXELS && head.tag.group() == FIRST_PIXELS.group() {
                return Ok(begin);
            }
            self.content(&head, self.bytes.len(), 0)?;
        }
        Ok(self.at)
    }

    /// Walks through the fragments of compressed pixels.
    pub fn fragments(&mut self) -> Result<Fragments<'a>, ContentError> {
        let mut parts = Vec::new();
        loop {
            let head = self.head()?;
            match head.tag {
                ITEM => parts.push(self.value(&head)?),
                SEQUENCE_END => break,
                other => return Err(invalid!("it is damaged: {other} is among its compressed pixels")),
            }
        }
        let mut parts = parts.into_iter();
        Ok(Fragments {
            table: parts.next().unwrap_or_default(),
            parts: parts.collect(),
        })
    }

    fn content(&mut self, head: &Head, end: usize, depth: usize) -> Result<(), ContentError> {
        self.elements += 1;
        if self.elements > MAX_ELEMENTS {
            return Err(invalid!("it has more than {MAX_ELEMENTS} elements"));
        }
        let nested = head.vr == VR::SQ || (self.syntax == Syntax::ImplicitLittle && head.length == UNDEFINED);
        if nested {
            return self.sequence(head, end, depth + 1);
        }
        self.value(head).and_then(|_| self.within(head.tag, end))
    }

    fn sequence(&mut self, head: &Head, end: usize, depth: usize) -> Result<(), ContentError> {
        if depth > MAX_DEPTH {
            return Err(invalid!("its sequences are nested more than {MAX_DEPTH} deep"));
        }
        self.inside(head, end, SEQUENCE_END, |walk, item, end| {
            if item.tag != ITEM {
                return Err(invalid!(
                    "in the sequence {} there is {} where an item must be",
                    head.tag,
                    item.tag
                ));
            }
            walk.inside(item, end, ITEM_END, |walk, head, end| walk.content(head, end, depth))
        })
    }

    /// Walks through the parts of an element, up to its own end or its delimiter.
    fn inside(
        &mut self,
        of: &Head,
        end: usize,
        delimiter: Tag,
        part: impl Fn(&mut Self, &Head, usize) -> Result<(), ContentError>,
    ) -> Result<(), ContentError> {
        let own_end = match of.length {
            UNDEFINED => None,
            length => Some(self.at + length as usize),
        };
        if own_end.is_some_and(|own| own > end) {
            return Err(self.too_long(of, end).into());
        }
        while self.at < own_end.unwrap_or(end) {
            let head = self.head()?;
            if head.tag == delimiter && own_end.is_none() && head.length == 0 {
                return Ok(());
            }
            part(self, &head, own_end.unwrap_or(end))?;
        }
        match own_end {
            Some(_) => self.within(of.tag, end),
            None => Err(invalid!("the element {} has no end", of.tag)),
        }
    }

    fn too_long(&self, head: &Head, end: usize) -> String {
        format!(
            "it is truncated or damaged: the element {} claims {} bytes and {} remain",
            head.tag,
            head.length,
            end.saturating_sub(self.at)
        )
    }

    fn within(&self, tag: Tag, end: usize) -> Result<(), ContentError> {
        if self.at <= end {
            return Ok(());
        }
        Err(invalid!("it is damaged: the element {tag} is longer than its parent"))
    }

    pub fn value(&mut self, head: &Head) -> Result<&'a [u8], ContentError> {
        if head.length == UNDEFINED {
            return Err(invalid!("the element {} ({}) has no length", head.tag, head.vr));
        }
        // The parser takes whole numbers only, and would continue in the middle of the value.
        if !head.length.is_multiple_of(size_of_number(head.vr)) {
            return Err(invalid!(
                "it is damaged: the element {} ({}) has {} bytes, no whole number of values",
                head.tag,
                head.vr,
                head.length
            ));
        }
        let value = self.bytes.get(self.at..self.at + head.length as usize);
        let value = value.ok_or_else(|| self.too_long(head, self.bytes.len()))?;
        self.at += value.len();
        Ok(value)
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let part = self
            .bytes
            .get(self.at..self.at + N)
            .and_then(|p| <[u8; N]>::try_from(p).ok());
        self.at += N;
        part.ok_or_else(|| "it is truncated in the middle of an element".to_owned())
    }

    fn u16(&mut self) -> Result<u16, ContentError> {
        let bytes = self.take()?;
        Ok(match self.syntax {
            Syntax::ExplicitBig => u16::from_be_bytes(bytes),
            _ => u16::from_le_bytes(bytes),
        })
    }

    fn u32(&mut self) -> Result<u32, ContentError> {
        let bytes = self.take()?;
        Ok(match self.syntax {
            Syntax::ExplicitBig => u32::from_be_bytes(bytes),
            _ => u32::from_le_bytes(bytes),
        })
    }

    pub fn group(&mut self) -> Result<u16, ContentError> {
        let at = self.at;
        let group = self.u16();
        self.at = at;
        group
    }

    pub fn head(&mut self) -> Result<Head, ContentError> {
        let begin = self.at;
        let tag = Tag(self.u16()?, self.u16()?);
        if tag == tags::SPECIFIC_CHARACTER_SET {
            self.charsets.push(begin);
        }
        if tag.group() == ITEM.group() {
            let length = self.u32()?;
            return Ok(Head {
                tag,
                vr: VR::UN,
                length,
            });
        }
        if self.syntax == Syntax::ImplicitLittle {
            let known = StandardDataDictionary.by_tag(tag).map(|e| e.vr().relaxed());
            let length = self.u32()?;
            return Ok(Head {
                tag,
                vr: known.unwrap_or(VR::UN),
                length,
            });
        }
        let code: [u8; 2] = self.take()?;
        let vr = VR::from_binary(code).ok_or_else(|| {
            format!(
                "the element {tag} is of a kind that DICOM does not have ({:?})",
                String::from_utf8_lossy(&code)
            )
        })?;
        let length = if !SHORT.contains(vr.to_string()) {
            self.u16()?;
            self.u32()?
        } else {
            u32::from(self.u16()?)
        };
        Ok(Head { tag, vr, length })
    }
}
