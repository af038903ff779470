//! A DICOM file as an object. Lengths and depth are checked first, because the parser allocates the
//! length that an element claims.

use super::super::element::Endian;
use super::compressed;
use super::parse::parse;
use super::walk::{FIRST_PIXELS, Syntax, UNDEFINED, Walk};
use crate::error::{ContentError, invalid};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use std::borrow::Cow;

/// Most values of a list, because each becomes a string of its own.
const MAX_VALUES: usize = 8 << 20;

/// DICOM data set without its pixels.
pub struct Object {
    /// SOP class UID.
    pub sop_class: String,
    /// The elements.
    pub data: InMemDicomObject,
    /// Remark on pixels that were compressed with loss, where they were read.
    pub(super) loss: Option<String>,
}

/// Returns whether the bytes begin like a DICOM file.
pub fn is_dicom(bytes: &[u8]) -> bool {
    has_preamble(bytes) || is_bare(bytes)
}

fn has_preamble(bytes: &[u8]) -> bool {
    bytes.get(128..132) == Some(b"DICM")
}

/// Returns whether the bytes begin like an old file: with their first element, of group 8, little
/// endian; nearly always the length of that group or the character set.
fn is_bare(bytes: &[u8]) -> bool {
    bytes.len() > 132 && bytes[..2] == [8, 0] && matches!(bytes[2..4], [0x00 | 0x01 | 0x05 | 0x08 | 0x12 | 0x16, 0])
}

/// Returns start and encoding of the data set; in a bare file two letters show the encoding.
fn syntax(bytes: &[u8]) -> Result<(Syntax, usize), ContentError> {
    if has_preamble(bytes) {
        let (uid, from) = transfer_syntax(bytes)?;
        return Ok((Syntax::of(&uid)?, from));
    }
    if !is_bare(bytes) {
        return Err("it has no DICM at byte 128, so it is not a DICOM file; export it again".into());
    }
    let letters = [bytes[4], bytes[5]];
    let explicit = VR::from_binary(letters).is_some();
    Ok((
        if explicit {
            Syntax::ExplicitLittle
        } else {
            Syntax::ImplicitLittle
        },
        0,
    ))
}

/// Reads everything before the pixels.
pub fn read(bytes: &[u8]) -> Result<Object, ContentError> {
    Ok(before(bytes, FIRST_PIXELS)?.0)
}

/// Like [`read`], without the contours of a structure set, the bulk of it.
pub fn read_head(bytes: &[u8]) -> Result<Object, ContentError> {
    Ok(before(bytes, tags::ROI_CONTOUR_SEQUENCE)?.0)
}

/// Like [`read`]; also returns the bytes of the pixels, unpacked, and the order of their bytes.
pub fn read_with_pixels(bytes: &[u8]) -> Result<(Object, Cow<'_, [u8]>, Endian), ContentError> {
    let (mut object, mut walk) = before(bytes, FIRST_PIXELS)?;
    if walk.at >= bytes.len() {
        return Err("it has no pixels; export it again".into());
    }
    let endian = match walk.syntax {
        Syntax::ExplicitBig => Endian::Big,
        _ => Endian::Little,
    };
    let uid = if has_preamble(bytes) {
        transfer_syntax(bytes)?.0
    } else {
        String::new()
    };
    object.loss = compressed::loss(&object.data, &uid);
    let head = walk.head()?;
    if compressed::is_compressed(&uid) != (head.length == UNDEFINED) {
        let uid = super::super::element::short(&uid);
        return Err(invalid!(
            "its pixels are not stored as its transfer syntax \"{uid}\" says; export it again"
        ));
    }
    let pixels = match head.length {
        UNDEFINED => Cow::Owned(compressed::unpacked(&object.data, &uid, &walk.fragments()?)?),
        _ => Cow::Borrowed(walk.value(&head)?),
    };
    Ok((object, pixels, endian))
}

/// Reads everything before the first pixels, or before `last`.
fn before(bytes: &[u8], last: Tag) -> Result<(Object, Walk<'_>), ContentError> {
    let values = bytes.iter().filter(|&&b| b == b'\\').count();
    if values > MAX_VALUES {
        return Err(invalid!(
            "it has {values} values in lists, more than {MAX_VALUES}; export fewer structures"
        ));
    }
    let (syntax, at) = syntax(bytes)?;
    let mut walk = Walk::new(bytes, at, syntax);
    let end = walk
        .top(last)
        .map_err(|why| format!("{why}; copy or export it again"))?;
    walk.at = end;
    let charsets: Vec<usize> = walk.charsets.iter().map(|begin| begin - at).collect();
    let data = parse(syntax, &bytes[at..end], &charsets)?;
    let sop_class = super::values::text(&data, tags::SOP_CLASS_UID).unwrap_or_default();
    let loss = None;
    Ok((Object { sop_class, data, loss }, walk))
}

/// Reads group 2, always explicit and little-endian: the encoding of the rest, and its start.
fn transfer_syntax(bytes: &[u8]) -> Result<(String, usize), ContentError> {
    let mut walk = Walk::new(bytes, 132, Syntax::ExplicitLittle);
    let mut found = None;
    while walk.at < bytes.len() && walk.group()? == 2 {
        let head = walk.head()?;
        let value = walk
            .value(&head)
            .map_err(|why| format!("{why}; copy or export it again"))?;
        if head.tag == tags::TRANSFER_SYNTAX_UID {
            found = Some(String::from_utf8_lossy(value).trim_end_matches(['\0', ' ']).to_owned());
        }
    }
    found
        .map(|uid| (uid, walk.at))
        .ok_or_else(|| "it does not say its transfer syntax; export it again".into())
}

#[cfg(test)]
mod tests;
