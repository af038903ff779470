//! Content of a message, of six types.

use super::CodecError;
use super::image::Image;
use super::polydata::PolyData;
use super::reader::{Reader, put_f32s, put_text};

/// US-ASCII in IANA's table of character sets; UTF-8 is sent under its own number.
const ASCII: u16 = 3;
const UTF8: u16 = 106;
const POINT_BYTES: usize = 136;

/// Named place.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// At most 64 bytes.
    pub name: String,
    /// At most 32 bytes.
    pub group: String,
    /// Red, green, blue, opacity.
    pub rgba: [u8; 4],
    /// Place, mm.
    pub place_mm: [f32; 3],
    /// Diameter, mm; 0 for a place without extent.
    pub diameter_mm: f32,
    /// Device of the image that it belongs to, at most 20 bytes, or none.
    pub owner: String,
}

/// State of a device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Status {
    /// Code: 1 is OK; the protocol's table lists the others.
    pub code: u16,
    /// Device's own number.
    pub subcode: i64,
    /// Name of the error, at most 20 bytes.
    pub error: String,
    /// Description.
    pub text: String,
}

impl Status {
    /// Creates the reason why a message is refused, with the protocol's number and name.
    pub fn refused(code: u16, name: &str, words: impl Into<String>) -> Self {
        Self {
            code,
            subcode: 0,
            error: name.to_owned(),
            text: words.into(),
        }
    }
}

/// Content of a message.
#[derive(Debug, Clone, PartialEq)]
pub enum Body {
    /// Columns of a matrix: three axes, and the origin in mm.
    Transform([[f32; 3]; 4]),
    /// Named places.
    Points(Vec<Point>),
    /// A surface.
    PolyData(PolyData),
    /// A grey picture.
    Image(Image),
    /// State of a device.
    Status(Status),
    /// A text.
    Text(String),
}

impl Body {
    /// Returns the type of the message in the header.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Transform(_) => "TRANSFORM",
            Self::Points(_) => "POINT",
            Self::PolyData(_) => "POLYDATA",
            Self::Image(_) => "IMAGE",
            Self::Status(_) => "STATUS",
            Self::Text(_) => "STRING",
        }
    }

    pub(super) fn encode(&self) -> Result<Vec<u8>, CodecError> {
        let mut bytes = Vec::new();
        match self {
            Self::Transform(columns) => columns.iter().for_each(|column| put_f32s(&mut bytes, column)),
            Self::Points(points) => points.iter().try_for_each(|point| point.encode(&mut bytes))?,
            Self::PolyData(surface) => surface.encode(&mut bytes)?,
            Self::Image(image) => image.encode(&mut bytes)?,
            Self::Status(status) => {
                bytes.extend(status.code.to_be_bytes());
                bytes.extend(status.subcode.to_be_bytes());
                put_text(&mut bytes, &status.error, 20)?;
                // The library writes the zero that ends a C string.
                put_text(&mut bytes, &status.text, status.text.len() + 1)?;
            }
            Self::Text(text) => {
                let length = u16::try_from(text.len())
                    .map_err(|_| CodecError::Field("STRING: a text of more than 65535 bytes"))?;
                let character_set = if text.is_ascii() { ASCII } else { UTF8 };
                bytes.extend(character_set.to_be_bytes());
                bytes.extend(length.to_be_bytes());
                bytes.extend(text.as_bytes());
            }
        }
        Ok(bytes)
    }

    pub(super) fn decode(kind: &'static str, body: &[u8]) -> Result<Self, CodecError> {
        let mut reader = Reader::new(kind, body);
        let decoded = match kind {
            "TRANSFORM" => {
                let columns = [reader.f32s()?, reader.f32s()?, reader.f32s()?, reader.f32s()?];
                if !columns.iter().flatten().all(|value: &f32| value.is_finite()) {
                    return Err(CodecError::Field("TRANSFORM: a number that is not finite"));
                }
                Self::Transform(columns)
            }
            "POINT" => {
                if !body.len().is_multiple_of(POINT_BYTES) {
                    return Err(CodecError::Field("POINT: the length is no multiple of 136 bytes"));
                }
                let points = (0..body.len() / POINT_BYTES).map(|_| Point::decode(&mut reader));
                Self::Points(points.collect::<Result<_, _>>()?)
            }
            "POLYDATA" => Self::PolyData(PolyData::decode(&mut reader)?),
            "IMAGE" => Self::Image(Image::decode(&mut reader)?),
            "STATUS" => Self::Status(Status {
                code: reader.u16()?,
                subcode: reader.u64()? as i64,
                error: reader.text(20)?,
                text: reader.text(reader.rest())?,
            }),
            "STRING" => {
                let _character_set = reader.u16()?;
                let length = usize::from(reader.u16()?);
                Self::Text(String::from_utf8_lossy(reader.take(length)?).into_owned())
            }
            _ => return Err(CodecError::Field("a type without a body")),
        };
        reader.end()?;
        Ok(decoded)
    }
}

impl Point {
    fn encode(&self, bytes: &mut Vec<u8>) -> Result<(), CodecError> {
        put_text(bytes, &self.name, 64)?;
        put_text(bytes, &self.group, 32)?;
        bytes.extend(self.rgba);
        put_f32s(bytes, &self.place_mm);
        put_f32s(bytes, &[self.diameter_mm]);
        put_text(bytes, &self.owner, 20)
    }

    fn decode(reader: &mut Reader) -> Result<Self, CodecError> {
        Ok(Self {
            name: reader.text(64)?,
            group: reader.text(32)?,
            rgba: [reader.u8()?, reader.u8()?, reader.u8()?, reader.u8()?],
            place_mm: reader.f32s()?,
            diameter_mm: reader.f32()?,
            owner: reader.text(20)?,
        })
    }
}
