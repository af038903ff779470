//! Pixels that are compressed: their frames from fragments, each unpacked by the decoder of its transfer syntax.

#[cfg(feature = "compressed")]
mod codecs;
mod rle;

use super::super::element::MAX_IMAGE_VOXELS;
use super::pixels;
use super::values::{name, needed, number, text};
use crate::error::{ContentError, invalid};
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;
use std::borrow::Cow;

/// Most pixels of a compressed frame, 4096 x 4096: a decoder needs a multiple of them while it works.
const MAX_PIXELS: usize = 1 << 24;
/// Most frames of one file.
const MAX_FRAMES: f64 = 65_535.0;
/// Bytes of the tag and the length before each fragment.
const HEAD_BYTES: usize = 8;

/// Method of compression.
#[derive(Clone, Copy, PartialEq)]
enum Codec {
    Rle,
    Jpeg,
    JpegLs,
    Jpeg2000,
}

/// Transfer syntaxes that are read, and whether they always or possibly lose something.
const SYNTAXES: [(&str, &str, Codec, Loss); 9] = [
    (uids::RLE_LOSSLESS, "RLE", Codec::Rle, Loss::Never),
    (uids::JPEG_BASELINE8_BIT, "JPEG baseline", Codec::Jpeg, Loss::Always),
    (uids::JPEG_EXTENDED12_BIT, "JPEG extended", Codec::Jpeg, Loss::Always),
    (uids::JPEG_LOSSLESS, "JPEG lossless", Codec::Jpeg, Loss::Never),
    (uids::JPEG_LOSSLESS_SV1, "JPEG lossless", Codec::Jpeg, Loss::Never),
    (uids::JPEGLS_LOSSLESS, "JPEG-LS lossless", Codec::JpegLs, Loss::Never),
    (
        uids::JPEGLS_NEAR_LOSSLESS,
        "JPEG-LS near-lossless",
        Codec::JpegLs,
        Loss::Possible,
    ),
    (
        uids::JPEG2000_LOSSLESS,
        "JPEG 2000 lossless",
        Codec::Jpeg2000,
        Loss::Never,
    ),
    (uids::JPEG2000, "JPEG 2000", Codec::Jpeg2000, Loss::Possible),
];

#[derive(Clone, Copy, PartialEq)]
enum Loss {
    Never,
    Possible,
    Always,
}

/// Returns whether the pixels of a transfer syntax are in fragments.
pub fn is_compressed(syntax: &str) -> bool {
    syntax.starts_with("1.2.840.10008.1.2.4.") || syntax == uids::RLE_LOSSLESS
}

/// Returns a remark if the pixels were compressed with loss, now or before.
pub fn loss(data: &InMemDicomObject, syntax: &str) -> Option<String> {
    let known = SYNTAXES.iter().find(|(uid, ..)| *uid == syntax);
    let declared = text(data, tags::LOSSY_IMAGE_COMPRESSION);
    let is_lossy = match known.map(|(.., loss)| *loss) {
        Some(Loss::Always) => true,
        Some(Loss::Possible) => declared.as_deref() != Some("00"),
        Some(Loss::Never) | None => declared.as_deref() == Some("01"),
    };
    is_lossy.then(|| {
        let method = known.map_or("another method", |(_, shown, ..)| shown);
        let method = if declared.as_deref() == Some("01") && known.is_none_or(|(.., loss)| *loss == Loss::Never) {
            "compressed with loss before".to_owned()
        } else {
            format!("compressed with loss by {method}")
        };
        format!(
            "its pixels are {method} ({}), so their values are near those of the original",
            name(tags::LOSSY_IMAGE_COMPRESSION)
        )
    })
}

/// Fragments of compressed pixels, as they are in the file.
pub struct Fragments<'a> {
    /// Offsets of the frames, 4 bytes each; often empty.
    pub table: &'a [u8],
    /// The fragments.
    pub parts: Vec<&'a [u8]>,
}

/// Storage of the pixels of one frame.
struct Layout {
    columns: usize,
    rows: usize,
    /// Bytes of a pixel.
    bytes: usize,
    #[cfg_attr(
        not(feature = "compressed"),
        expect(dead_code, reason = "only the codecs ask for it")
    )]
    stored: u32,
    #[cfg_attr(
        not(feature = "compressed"),
        expect(dead_code, reason = "only the codecs ask for it")
    )]
    is_signed: bool,
}

impl Layout {
    fn of(data: &InMemDicomObject) -> Result<Self, ContentError> {
        let [columns, rows] = pixels::size(data)?;
        let samples = number(data, tags::SAMPLES_PER_PIXEL)?.unwrap_or(1.0);
        let bits = needed(data, tags::BITS_ALLOCATED, 1.0, 64.0)?;
        if samples != 1.0 || ![8.0, 16.0, 32.0].contains(&bits) {
            return Err(invalid!(
                "its pixels are compressed, with {samples} values of {bits} bits each; one of 8, 16 or 32 is read"
            ));
        }
        if columns * rows > MAX_PIXELS {
            return Err(invalid!(
                "its compressed frames have {columns} x {rows} pixels, more than {MAX_PIXELS} in all; export a part of it"
            ));
        }
        Ok(Self {
            columns,
            rows,
            bytes: bits as usize / 8,
            stored: needed(data, tags::BITS_STORED, 1.0, bits)? as u32,
            is_signed: needed(data, tags::PIXEL_REPRESENTATION, 0.0, 1.0)? == 1.0,
        })
    }

    fn pixels(&self) -> usize {
        self.columns * self.rows
    }
}

/// Returns the pixels of all frames, little endian.
pub fn unpacked(data: &InMemDicomObject, syntax: &str, fragments: &Fragments) -> Result<Vec<u8>, ContentError> {
    let Some((_, method, codec, _)) = SYNTAXES.iter().find(|(uid, ..)| *uid == syntax) else {
        return Err(invalid!(
            "its pixels are compressed by a method that is not read (transfer syntax {syntax}); export it without compression"
        ));
    };
    let layout = Layout::of(data)?;
    let count = match number(data, tags::NUMBER_OF_FRAMES)? {
        Some(_) => needed(data, tags::NUMBER_OF_FRAMES, 1.0, MAX_FRAMES)? as usize,
        None => 1,
    };
    if layout.pixels().saturating_mul(count) > MAX_IMAGE_VOXELS {
        return Err(invalid!(
            "it has {count} frames of {} pixels, more than {MAX_IMAGE_VOXELS} in all; export a part of it",
            layout.pixels()
        ));
    }
    let mut all = Vec::new();
    for (n, frame) in fragments.frames(count)?.iter().enumerate() {
        let within = |why: ContentError| why.within(format_args!("frame {} of {count}, {method}", n + 1));
        match codec {
            Codec::Rle => rle::decode(frame, &layout, &mut all).map_err(within)?,
            #[cfg(feature = "compressed")]
            codec => codecs::decode(*codec, frame, &layout, &mut all).map_err(within)?,
            #[cfg(not(feature = "compressed"))]
            _ => {
                return Err(invalid!(
                    "its pixels are compressed ({method}, transfer syntax {syntax}), which this program was built without: \
                     take one built with --features stylet-files/compressed, or export it without compression"
                ));
            }
        }
    }
    Ok(all)
}

impl<'a> Fragments<'a> {
    /// Returns the bytes of each frame; a frame may be in several fragments.
    fn frames(&self, count: usize) -> Result<Vec<Cow<'a, [u8]>>, ContentError> {
        if self.parts.len() == count {
            return Ok(self.parts.iter().copied().map(Cow::Borrowed).collect());
        }
        let offsets = self
            .table
            .chunks_exact(4)
            .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        let starts: Vec<usize> = match count {
            1 => vec![0],
            _ => offsets.map(|offset| offset as usize).collect(),
        };
        let (mut frames, mut at) = (Vec::<Vec<u8>>::new(), 0);
        for part in &self.parts {
            if starts.get(frames.len()) == Some(&at) {
                frames.push(Vec::new());
            }
            if let Some(frame) = frames.last_mut() {
                frame.extend_from_slice(part);
            }
            at += HEAD_BYTES + part.len();
        }
        if frames.len() != count {
            return Err(invalid!(
                "its {count} frames ({}) are compressed in {} fragments, and it does not say which belong together; export it again",
                name(tags::NUMBER_OF_FRAMES),
                self.parts.len()
            ));
        }
        Ok(frames.into_iter().map(Cow::Owned).collect())
    }
}

#[cfg(test)]
mod tests;
