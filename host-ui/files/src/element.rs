//! The numbers in a volume's data, as labels or greys; memory grows only with the actual data.

use super::progress::{Progress, Stage};
use crate::error::{ContentError, invalid};
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
        return Err(invalid!("its size is {} voxels; each side must be at least 1", size()));
    }
    match dims.iter().try_fold(1_u64, |n, &d| n.checked_mul(d)) {
        Some(n) if n <= MAX_VOXELS => Ok(n as usize),
        _ => Err(invalid!(
            "its header claims {} voxels, more than {MAX_VOXELS} in all; crop it to the gland",
            size()
        )),
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
    Err(invalid!(
        "it is truncated or its header is wrong: the header requires {needed} bytes and the {have} bytes present cannot hold them; copy or export it again"
    ))
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
            return Err(invalid!(
                "it has {count} voxels, more than {}; crop it to the gland",
                self.most
            ));
        }
        Ok(Vec::with_capacity(count.min(CHUNK_BYTES)))
    }
}

/// Storage of the values of a volume.
#[derive(Clone, Copy, Debug)]
pub struct Stored {
    /// Type of a value.
    pub element: Element,
    /// Order of its bytes.
    pub endian: Endian,
    /// Number of values.
    pub count: usize,
}

impl Stored {
    fn bytes(self) -> u64 {
        (self.count * self.element.bytes()) as u64
    }

    /// Reads values behind `skip` bytes, or at the end of the data if `skip` is -1; nothing may follow them.
    pub fn raw<V>(self, data: &[u8], skip: i64, sink: Sink<V>) -> Result<Vec<V>, ContentError> {
        let needed = self.bytes();
        let data = match skip {
            -1 => &data[data.len().saturating_sub(needed as usize)..],
            n => data.get(n as usize..).unwrap_or_default(),
        };
        let have = data.len() as u64;
        must_hold(needed, have, false)?;
        if have > needed {
            return Err(invalid!(
                "the header asks for {needed} bytes and {have} are there: header and data do not belong together; export it again"
            ));
        }
        read_values(data, self.element, self.endian, self.count, [1.0, 0.0], sink)
    }

    /// Reads the values of a stream, behind `skip` bytes; `packed` bytes hold them, and nothing may follow them.
    pub fn packed<V>(
        self,
        mut from: impl Read,
        packed: usize,
        skip: u64,
        sink: Sink<V>,
    ) -> Result<Vec<V>, ContentError> {
        must_hold(self.bytes().saturating_add(skip), packed as u64, true)?;
        skip_bytes(&mut from, skip)?;
        let values = read_values(&mut from, self.element, self.endian, self.count, [1.0, 0.0], sink)?;
        match from.read(&mut [0]) {
            Ok(0) => Ok(values),
            Ok(_) => {
                Err("its data continue beyond the size in its header: header and data do not belong together".into())
            }
            Err(e) => Err(format!("it is damaged ({e}); copy or export it again").into()),
        }
    }

    /// Reads values in text form.
    pub fn text<V>(self, text: &[u8], sink: Sink<V>) -> Result<Vec<V>, ContentError> {
        must_hold(self.count as u64, text.len() as u64, false)?;
        values_from_text(text, self.count, sink)
    }
}

/// Skips bytes of a stream.
pub fn skip_bytes(from: &mut impl Read, count: u64) -> Result<(), ContentError> {
    std::io::copy(&mut from.by_ref().take(count), &mut std::io::sink())
        .map_err(|e| format!("it is truncated or damaged ({e}); copy or export it again"))?;
    Ok(())
}

/// Reads numbers separated by spaces; `None` if one of the words is no number.
pub fn parsed<T: std::str::FromStr>(text: &str) -> Option<Vec<T>> {
    text.split_whitespace().map(|word| word.parse().ok()).collect()
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

fn values_from_text<V>(text: &[u8], count: usize, sink: Sink<V>) -> Result<Vec<V>, ContentError> {
    let text = std::str::from_utf8(text).map_err(|_| "its numbers are not text".to_owned())?;
    let words = text
        .split(|c: char| c.is_ascii_whitespace() || c == ',')
        .filter(|w| !w.is_empty());
    let mut values = sink.values(count)?;
    for word in words {
        if values.len() == count {
            return Err(invalid!(
                "it contains more than the {count} values of its size; export it again"
            ));
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
    Err(invalid!(
        "it is truncated: {} of {count} values are there; copy or export it again",
        values.len()
    ))
}

/// Converts a number to a label; returns an error unless it is a whole number from 0 to 255.
pub fn label_of(value: f64) -> Result<u8, ContentError> {
    let whole = value.round();
    if (value - whole).abs() < 1e-3 && (0.0..=255.0).contains(&whole) {
        return Ok(whole as u8);
    }
    Err(invalid!(
        "it contains the value {value}; a segmentation has whole numbers 0 to 255. Is this the image instead of its labels?"
    ))
}

/// Shortens a foreign text, keeping enough to recognise it.
pub fn short(text: &str) -> String {
    let mut start: String = text.chars().take(40).filter(|c| !c.is_control()).collect();
    if start.len() < text.len() {
        start.push_str("...");
    }
    start
}
