//! Codec of OpenIGTLink messages, header version 1; version 2 is read, not written. No I/O; every
//! length is checked before memory is allocated for it.
//!
//! Source: the messages that libOpenIGTLink 1.11 writes, byte for byte. Lengths are in mm and
//! places in the frame that the sender names, for Stylet the patient's (RAS).

mod body;
mod crc;
mod header;
mod image;
mod polydata;
mod reader;

pub use body::{Body, Point, Status};
pub use crc::crc64;
pub use header::{HEADER_BYTES, Header, Timestamp};
pub use image::Image;
pub use polydata::PolyData;

/// Error of bytes that are not a message, or of a message that cannot be encoded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CodecError {
    /// The bytes end before the message does.
    #[error("{what}: {needed} bytes expected, {found} found")]
    Short {
        /// Part of the message.
        what: &'static str,
        /// Number of bytes needed.
        needed: usize,
        /// Number of bytes present.
        found: usize,
    },
    /// The version of the header is unknown.
    #[error("header version 1 or 2 expected, {0} found")]
    Version(u16),
    /// The type of message is not among the six.
    #[error(
        "message type {kind:?} is not supported; supported are TRANSFORM, POINT, POLYDATA, IMAGE, STATUS and STRING"
    )]
    Type {
        /// Name of the type.
        kind: String,
        /// Device of the sender.
        device: String,
        /// Length of the body in the header, so that it can be skipped.
        body_bytes: u64,
    },
    /// The body exceeds the limit of its type.
    #[error("{kind} of {found} bytes: at most {limit} are accepted")]
    TooLong {
        /// Type of the message.
        kind: &'static str,
        /// Length that the header states.
        found: u64,
        /// Largest length accepted.
        limit: u64,
    },
    /// The checksum of the body differs from the header's.
    #[error("checksum {found:#018x}: the header states {stated:#018x}")]
    Checksum {
        /// Checksum in the header.
        stated: u64,
        /// Checksum of the body.
        found: u64,
    },
    /// A field contradicts another or is outside its range.
    #[error("{0}")]
    Field(&'static str),
}

/// Message of a device, with time and content.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// Name of the device, at most 20 bytes; Slicer names its node after it.
    pub device: String,
    /// Time of the measurement.
    pub time: Timestamp,
    /// Content.
    pub body: Body,
}

impl Message {
    /// Encodes the message. Fails if a text or a list is longer than its field.
    pub fn encode(&self) -> Result<Vec<u8>, CodecError> {
        let body = self.body.encode()?;
        let kind = self.body.kind();
        header::check_length(kind, body.len() as u64)?;
        let header = Header {
            kind,
            is_extended: false,
            device: self.device.clone(),
            time: self.time,
            body_bytes: body.len(),
            checksum: crc64(&body),
        };
        let mut bytes = header.encode()?.to_vec();
        bytes.extend_from_slice(&body);
        Ok(bytes)
    }

    /// Decodes one whole message; bytes after its end are an error.
    pub fn decode(bytes: &[u8]) -> Result<Self, CodecError> {
        let (head, body) = bytes.split_at_checked(HEADER_BYTES).ok_or(CodecError::Short {
            what: "header",
            needed: HEADER_BYTES,
            found: bytes.len(),
        })?;
        Self::of(&Header::decode(head)?, body)
    }

    /// Creates a message of a header that was decoded, and its body.
    pub fn of(header: &Header, body: &[u8]) -> Result<Self, CodecError> {
        if body.len() != header.body_bytes {
            return Err(CodecError::Short {
                what: "body",
                needed: header.body_bytes,
                found: body.len(),
            });
        }
        let found = crc64(body);
        if found != header.checksum {
            let stated = header.checksum;
            return Err(CodecError::Checksum { stated, found });
        }
        Ok(Self {
            device: header.device.clone(),
            time: header.time,
            body: Body::decode(header.kind, header.content(body)?)?,
        })
    }
}

#[cfg(test)]
mod tests;
