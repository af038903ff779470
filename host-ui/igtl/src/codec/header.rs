//! The 58 bytes before every body, and the limits of bodies.

use super::CodecError;
use super::reader::{Reader, put_text};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Length of a header of version 1.
pub const HEADER_BYTES: usize = 58;
const VERSION: u16 = 1;
/// Version whose bodies begin with a second header and end with pairs of words, both of which are
/// skipped.
const EXTENDED_VERSION: u16 = 2;
/// Largest extension of an extended body.
const EXTENSION_AT_MOST: u64 = 4096;

/// Types and the largest bodies of them that are accepted or sent, in bytes.
const LIMITS: [(&str, u64); 6] = [
    ("TRANSFORM", 48),
    ("POINT", 136 * 4096),
    ("POLYDATA", 16 << 20),
    ("IMAGE", 72 + 2048 * 2048),
    ("STATUS", 30 + 4096),
    ("STRING", 4 + 65_535),
];

/// Seconds since 1970 and 2^-32 of a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Timestamp {
    /// Whole seconds.
    pub seconds: u32,
    /// Fraction of a second, in units of 2^-32.
    pub fraction: u32,
}

impl Timestamp {
    /// Reads this machine's clock.
    pub fn now() -> Self {
        Self::since_1970(SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default())
    }

    /// Converts a time since 1970; seconds beyond 32 bits (the year 2106) are cut off.
    pub fn since_1970(time: Duration) -> Self {
        Self {
            seconds: time.as_secs() as u32,
            fraction: ((u64::from(time.subsec_nanos()) << 32) / 1_000_000_000) as u32,
        }
    }
}

/// Header of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// Type, one of six.
    pub kind: &'static str,
    /// True for version 2, as protocol 3 sends it.
    pub is_extended: bool,
    /// Name of the device.
    pub device: String,
    /// Time of the measurement.
    pub time: Timestamp,
    /// Length of the body, within the limit of its type.
    pub body_bytes: usize,
    /// CRC-64 of the body.
    pub checksum: u64,
}

/// Checks the length of a body against the limit of its type.
pub fn check_length(kind: &'static str, found: u64) -> Result<(), CodecError> {
    let limit = LIMITS.iter().find(|row| row.0 == kind).map_or(0, |row| row.1);
    match found <= limit {
        true => Ok(()),
        false => Err(CodecError::TooLong { kind, found, limit }),
    }
}

impl Header {
    /// Decodes 58 bytes; the length is within its limit afterwards.
    pub fn decode(bytes: &[u8]) -> Result<Self, CodecError> {
        let mut reader = Reader::new("header", bytes);
        let version = reader.u16()?;
        if ![VERSION, EXTENDED_VERSION].contains(&version) {
            return Err(CodecError::Version(version));
        }
        let is_extended = version == EXTENDED_VERSION;
        let kind = reader.text(12)?;
        let device = reader.text(20)?;
        let time = Timestamp {
            seconds: reader.u32()?,
            fraction: reader.u32()?,
        };
        let body_bytes = reader.u64()?;
        let checksum = reader.u64()?;
        reader.end()?;
        let Some((kind, _)) = LIMITS.iter().find(|row| row.0 == kind) else {
            return Err(CodecError::Type {
                kind,
                device,
                body_bytes,
            });
        };
        let extension = if is_extended { EXTENSION_AT_MOST } else { 0 };
        check_length(kind, body_bytes.saturating_sub(extension))?;
        Ok(Self {
            kind,
            is_extended,
            device,
            time,
            body_bytes: body_bytes as usize,
            checksum,
        })
    }

    /// Returns the content of a body, without the second header and the words around an extended
    /// one.
    pub(super) fn content<'a>(&self, body: &'a [u8]) -> Result<&'a [u8], CodecError> {
        if !self.is_extended {
            return Ok(body);
        }
        let mut reader = Reader::new("second header", body);
        let (own, words_head, words) = (reader.u16()?, reader.u16()?, reader.u32()?);
        let around = [usize::from(own), usize::from(words_head), words as usize];
        let around = around.into_iter().try_fold(0_usize, usize::checked_add);
        let content = around.and_then(|around| body.len().checked_sub(around));
        content
            .and_then(|length| body.get(usize::from(own)..)?.get(..length))
            .ok_or(CodecError::Field(
                "the second header states lengths that do not fit the body",
            ))
    }

    /// Returns its 58 bytes, of version 1.
    pub fn encode(&self) -> Result<[u8; HEADER_BYTES], CodecError> {
        let mut bytes = Vec::with_capacity(HEADER_BYTES);
        bytes.extend(VERSION.to_be_bytes());
        put_text(&mut bytes, self.kind, 12)?;
        put_text(&mut bytes, &self.device, 20)?;
        bytes.extend(self.time.seconds.to_be_bytes());
        bytes.extend(self.time.fraction.to_be_bytes());
        bytes.extend((self.body_bytes as u64).to_be_bytes());
        bytes.extend(self.checksum.to_be_bytes());
        let mut array = [0; HEADER_BYTES];
        array.copy_from_slice(&bytes);
        Ok(array)
    }
}
