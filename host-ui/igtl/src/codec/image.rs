//! A picture of one byte for each pixel, with its place.

use super::CodecError;
use super::reader::{Reader, put_f32s};

const VERSION: u16 = 1;
/// One component of unsigned bytes, in RAS.
const GREYS: [u8; 2] = [1, 3];
const RAS: u8 = 1;
/// Big endian, as libOpenIGTLink writes it; bytes have no order.
const BIG: u8 = 1;

/// Grey picture or volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Number of columns, rows and slices.
    pub size: [u16; 3],
    /// Columns of a matrix: the ways to the next column, row and slice, and the centre of all
    /// pixels; RAS, mm.
    pub columns: [[f32; 3]; 4],
    /// Greys, row by row.
    pub greys: Vec<u8>,
}

impl Image {
    pub(super) fn encode(&self, bytes: &mut Vec<u8>) -> Result<(), CodecError> {
        self.check()?;
        bytes.extend(VERSION.to_be_bytes());
        bytes.extend(GREYS);
        bytes.extend([BIG, RAS]);
        put_u16s(bytes, self.size);
        self.columns.iter().for_each(|column| put_f32s(bytes, column));
        put_u16s(bytes, [0; 3]);
        put_u16s(bytes, self.size);
        bytes.extend(&self.greys);
        Ok(())
    }

    pub(super) fn decode(reader: &mut Reader) -> Result<Self, CodecError> {
        let (version, kind, _endian, frame) = (reader.u16()?, [reader.u8()?, reader.u8()?], reader.u8()?, reader.u8()?);
        if (version, kind, frame) != (VERSION, GREYS, RAS) {
            return Err(CodecError::Field(
                "IMAGE: only version 1, one component of unsigned bytes and RAS are accepted",
            ));
        }
        let size = [reader.u16()?, reader.u16()?, reader.u16()?];
        let columns = [reader.f32s()?, reader.f32s()?, reader.f32s()?, reader.f32s()?];
        let mut part = [0; 6];
        for number in &mut part {
            *number = reader.u16()?;
        }
        if part[..3] != [0; 3] || part[3..] != size {
            return Err(CodecError::Field("IMAGE: a part of an image is not accepted"));
        }
        let greys = reader.take(reader.rest())?.to_vec();
        let image = Self { size, columns, greys };
        image.check().map(|()| image)
    }

    fn check(&self) -> Result<(), CodecError> {
        let count: u64 = self.size.iter().map(|&side| u64::from(side)).product();
        match count == self.greys.len() as u64 {
            true => Ok(()),
            false => Err(CodecError::Field("IMAGE: the size does not fit the number of bytes")),
        }
    }
}

fn put_u16s(bytes: &mut Vec<u8>, values: [u16; 3]) {
    values.iter().for_each(|value| bytes.extend(value.to_be_bytes()));
}
