//! RLE of DICOM (PS3.5 annex G): the bytes of a frame's pixels in planes, the highest first, each packed by itself.
//!
//! The decoder of the DICOM library reads beyond a damaged stream's end and panics.

use super::Layout;
use crate::error::{ContentError, invalid};

/// Bytes of the header: the number of planes and 15 places.
const HEADER_BYTES: usize = 64;

/// Adds the pixels of a frame, little endian.
pub fn decode(frame: &[u8], layout: &Layout, all: &mut Vec<u8>) -> Result<(), ContentError> {
    let word = |n: usize| {
        let bytes = frame.get(4 * n..4 * n + 4).and_then(|b| <[u8; 4]>::try_from(b).ok());
        bytes.map(|bytes| u32::from_le_bytes(bytes) as usize)
    };
    let planes = word(0).filter(|_| frame.len() >= HEADER_BYTES);
    if planes != Some(layout.bytes) {
        return Err(invalid!(
            "it is damaged: it has {} planes of bytes, and a pixel {} bytes",
            planes.unwrap_or_default(),
            layout.bytes
        ));
    }
    let count = layout.pixels();
    let begin = all.len();
    for plane in 0..layout.bytes {
        let from = word(1 + plane).unwrap_or_default();
        let to = if plane + 1 < layout.bytes {
            word(2 + plane)
        } else {
            None
        };
        let packed = frame
            .get(from..to.unwrap_or(frame.len()))
            .filter(|_| from >= HEADER_BYTES);
        let bytes = unpacked(packed.unwrap_or_default(), count)?;
        // Allocated only once the first plane was there.
        all.resize(begin + count * layout.bytes, 0);
        let place = layout.bytes - 1 - plane;
        for (pixel, byte) in all[begin..].chunks_exact_mut(layout.bytes).zip(bytes) {
            pixel[place] = byte;
        }
    }
    Ok(())
}

/// Unpacks exactly `count` bytes; one byte may follow to make the length even.
fn unpacked(mut packed: &[u8], count: usize) -> Result<Vec<u8>, ContentError> {
    let mut bytes = Vec::new();
    while bytes.len() < count {
        let Some((&head, rest)) = packed.split_first() else {
            return Err(invalid!(
                "it is truncated: {} of {count} pixels are there; copy or export it again",
                bytes.len()
            ));
        };
        // The length less one of bytes as they are, or of one byte repeated; -128 is empty.
        let (taken, length) = match head as i8 {
            -128 => (0, 0),
            repeated @ ..0 => (1, 1 - isize::from(repeated)),
            own => (usize::from(own as u8) + 1, isize::from(own) + 1),
        };
        let Some((own, rest)) = rest.split_at_checked(taken) else {
            return Err("it is truncated in the middle of a run; copy or export it again".into());
        };
        match own {
            [one] => bytes.resize(bytes.len() + length as usize, *one),
            several => bytes.extend_from_slice(several),
        }
        packed = rest;
    }
    if bytes.len() > count || packed.len() > 1 {
        return Err(invalid!(
            "it has more than {count} pixels: Rows or Columns are not those of its pixels"
        ));
    }
    Ok(bytes)
}
