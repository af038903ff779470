//! The elements of a checked data set, with their texts decoded by the declared character sets.

use super::charset::{self, Sets};
use super::walk::Syntax;
use crate::error::ContentError;
use dicom_core::Tag;
use dicom_dictionary_std::uids;
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use std::io::Read;

/// Tag under which the declared character sets are kept: the parser knows only some of them, and
/// none that change by escapes, so it gets each byte as one letter of Latin-1.
const DECLARED: Tag = Tag(0x0008, 0x0004);
const LATIN_1: [u8; 10] = *b"ISO_IR 100";

/// Parses with a group 2 of our own in front, because the file's has served; `charsets` are the
/// places of the elements that declare character sets.
pub fn parse(syntax: Syntax, dataset: &[u8], charsets: &[usize]) -> Result<InMemDicomObject, ContentError> {
    let meta = FileMetaTableBuilder::new()
        .transfer_syntax(syntax.uid())
        .media_storage_sop_class_uid(uids::RAW_DATA_STORAGE)
        .media_storage_sop_instance_uid("2.25.0")
        .build()
        .map_err(|e| e.to_string())?;
    let mut front = [[0; 128].as_slice(), b"DICM"].concat();
    meta.write(&mut front).map_err(|e| e.to_string())?;
    let length = LATIN_1.len() as u8;
    front.extend(match syntax {
        Syntax::ImplicitLittle => [8, 0, 5, 0, length, 0, 0, 0],
        Syntax::ExplicitLittle => [8, 0, 5, 0, b'C', b'S', length, 0],
        Syntax::ExplicitBig => [0, 8, 0, 5, b'C', b'S', 0, length],
    });
    front.extend(LATIN_1);
    let mut renamed = dataset.to_vec();
    for begin in charsets {
        if let Some(element) = renamed.get_mut(begin + 2..begin + 4) {
            // Of either byte order.
            element.iter_mut().for_each(|byte| *byte = (*byte).min(4));
        }
    }
    let parsed = dicom_object::from_reader(front.as_slice().chain(renamed.as_slice()));
    let parsed = parsed.map_err(|e| format!("it cannot be read ({e}); export it again"))?;
    let mut object = parsed.into_inner();
    charset::decode(&mut object, DECLARED, &Sets::none())?;
    Ok(object)
}
