//! The numbers in a volume's data, as labels or greys; memory grows only with the actual data.

use super::progress::{Progress, Stage};
use crate::error::ContentError;
use std::io::Read;

/// Most voxels of a volume; a larger one is not a prostate.
pub const MAX_VOXELS: u64 = 1 << 28;
/// Most voxels of an image, 512 x 512 x 512: its greys are kept while it is shown.
pub const MAX_IMAGE_VOXELS: usize = 1 << 27;
/// Largest compression ratio of deflate.
pub const MAX_DEFLATE_RATIO: u64 = 1032;
/// Bytes read at a time; a whole number of elements of any type.
const CHUNK_BYTES: usize = 1 << 16;

/// Storage type of a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// Unsigned, 8 bits.
    U8,
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Signed, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Signed, 32 bits.
    I32,
    /// Unsigned, 64 bits.
    U64,
    /// Signed, 64 bits.
    I64,
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

/// Order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Endian {
    /// Lowest byte first.
    Little,
    /// Highest byte first.
    Big,
}

impl Element {
    /// Returns the bytes of one element.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    fn value(self, bytes: &[u8], endian: Endian) -> f64 {
        let mut b = [0_u8; 8];
        let n = bytes.len();
        match endian {
            Endian::Little => b[..n].copy_from_slice(bytes),
            Endian::Big => b[..n]
                .iter_mut()
                .zip(bytes.iter().rev())
                .for_each(|(to, from)| *to = *from),
        }
        let [b0, b1, b2, b3, ..] = b;
        match self {
            Self::U8 => f64::from(b0),
            Self::I8 => f64::from(b0 as i8),
            Self::U16 => f64::from(u16::from_le_bytes([b0, b1])),
            Self::I16 => f64::from(i16::from_le_bytes([b0, b1])),
            Self::U32 => f64::from(u32::from_le_bytes([b0, b1, b2, b3])),
            Self::I32 => f64::from(i32::from_le_bytes([b0, b1, b2, b3])),
            Self::F32 => f64::from(f32::from_le_bytes([b0, b1, b2, b3])),
            Self::U64 => u64::from_le_bytes(b) as f64,
            Self::I64 => i64::from_le_bytes(b) as f64,
            Self::F64 => f64::from_le_bytes(b),
        }
    }
}

/// Returns how many voxels a header claims, if that is plausible at all.
pub fn voxel_count(dims: &[u64]) -> Result<usize, ContentError> {
    let size = || dims.iter().map(u64::to_string).collect::<Vec<_>>().join(" x ");
    if dims.contains(&0) {
        return Err(ContentError::Invalid(format!(
            "its size is {} voxels; each side must be at least 1",
            size()
        )));
    }
    match dims.iter().try_fold(1_u64, |n, &d| n.checked_mul(d)) {
        Some(n) if n <= MAX_VOXELS => Ok(n as usize),
        _ => Err(ContentError::Invalid(format!(
            "its header claims {} voxels, more than {MAX_VOXELS} in all; crop it to the gland",
            size()
        ))),
    }
}

/// Checks that data of this many bytes can hold the volume that the header claims, before it is
/// allocated.
pub fn must_hold(needed: u64, have: u64, packed: bool) -> Result<(), ContentError> {
    let most = if packed {
        have.saturating_mul(MAX_DEFLATE_RATIO)
    } else {
        have
    };
    if needed <= most {
        return Ok(());
    }
    Err(ContentError::Invalid(format!(
        "it is truncated or its header is wrong: the header requires {needed} bytes and the {have} bytes present cannot hold them; copy or export it again"
    )))
}

/// Conversion of each number, and receiver of progress.
#[derive(Clone, Copy, Debug)]
pub struct Sink<'a, V> {
    made_of: fn(f64) -> Result<V, ContentError>,
    most: usize,
    progress: &'a Progress,
}

impl<'a> Sink<'a, u8> {
    /// Takes numbers as labels.
    pub fn labels(progress: &'a Progress) -> Self {
        Self {
            made_of: label_of,
            most: MAX_VOXELS as usize,
            progress,
        }
    }
}

impl<'a> Sink<'a, f32> {
    /// Takes numbers as greys.
    pub fn greys(progress: &'a Progress) -> Self {
        Self {
            made_of: |value| Ok(value as f32),
            most: MAX_IMAGE_VOXELS,
            progress,
        }
    }
}

impl<'a> Sink<'a, f64> {
    /// Takes numbers of an image unchanged.
    pub fn exact(progress: &'a Progress) -> Self {
        Self {
            made_of: Ok,
            most: MAX_IMAGE_VOXELS,
            progress,
        }
    }
}

impl<V> Sink<'_, V> {
    /// Returns an empty list that grows with the actual data.
    fn values(&self, count: usize) -> Result<Vec<V>, ContentError> {
        if count > self.most {
            return Err(ContentError::Invalid(format!(
                "it has {count} voxels, more than {}; crop it to the gland",
                self.most
            )));
        }
        Ok(Vec::with_capacity(count.min(CHUNK_BYTES)))
    }
}

/// Reads exactly `count` values, each the stored number times `slope` plus `intercept`.
pub fn read_values<V>(
    mut from: impl Read,
    element: Element,
    endian: Endian,
    count: usize,
    [slope, intercept]: [f64; 2],
    sink: Sink<V>,
) -> Result<Vec<V>, ContentError> {
    let size = element.bytes();
    let mut values = sink.values(count)?;
    let mut chunk = vec![0_u8; CHUNK_BYTES];
    while values.len() < count {
        sink.progress.report(Stage::Voxels, values.len(), count)?;
        let part = &mut chunk[..((count - values.len()) * size).min(CHUNK_BYTES)];
        from.read_exact(part)
            .map_err(|e| format!("it is truncated or damaged ({e}); copy or export it again"))?;
        for bytes in part.chunks_exact(size) {
            values.push((sink.made_of)(element.value(bytes, endian) * slope + intercept)?);
        }
    }
    Ok(values)
}

/// Like [`read_values`], from numbers in text form.
pub fn values_from_text<V>(text: &[u8], count: usize, sink: Sink<V>) -> Result<Vec<V>, ContentError> {
    let text = std::str::from_utf8(text).map_err(|_| "its numbers are not text".to_owned())?;
    let words = text
        .split(|c: char| c.is_ascii_whitespace() || c == ',')
        .filter(|w| !w.is_empty());
    let mut values = sink.values(count)?;
    for word in words {
        if values.len() == count {
            return Err(ContentError::Invalid(format!(
                "it contains more than the {count} values of its size; export it again"
            )));
        }
        let value: f64 = word
            .parse()
            .map_err(|_| format!("it contains \"{}\" in place of a number", short(word)))?;
        if values.len() % CHUNK_BYTES == 0 {
            sink.progress.report(Stage::Voxels, values.len(), count)?;
        }
        values.push((sink.made_of)(value)?);
    }
    if values.len() == count {
        return Ok(values);
    }
    Err(ContentError::Invalid(format!(
        "it is truncated: {} of {count} values are there; copy or export it again",
        values.len()
    )))
}

/// Converts a number to a label; returns an error unless it is a whole number from 0 to 255.
pub fn label_of(value: f64) -> Result<u8, ContentError> {
    let whole = value.round();
    if (value - whole).abs() < 1e-3 && (0.0..=255.0).contains(&whole) {
        return Ok(whole as u8);
    }
    Err(ContentError::Invalid(format!(
        "it contains the value {value}; a segmentation has whole numbers 0 to 255. Is this the image instead of its labels?"
    )))
}

/// Shortens a foreign text, keeping enough to recognise it.
pub fn short(text: &str) -> String {
    let mut start: String = text.chars().take(40).filter(|c| !c.is_control()).collect();
    if start.len() < text.len() {
        start.push_str("...");
    }
    start
}
