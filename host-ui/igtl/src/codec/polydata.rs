//! A surface as points and triangles.

use super::CodecError;
use super::reader::{Reader, put_f32s, put_u32s};

/// Surface without attributes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PolyData {
    /// Places, mm.
    pub points: Vec<[f32; 3]>,
    /// Points of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

const POINT_BYTES: usize = 12;
/// Bytes of a triangle: the number of its points, and their indices.
const TRIANGLE_BYTES: usize = 16;

impl PolyData {
    pub(super) fn encode(&self, bytes: &mut Vec<u8>) -> Result<(), CodecError> {
        self.check()?;
        let count = |n: usize| u32::try_from(n).map_err(|_| CodecError::Field("POLYDATA: more than 2^32 elements"));
        let (points, triangles) = (count(self.points.len())?, count(self.triangles.len())?);
        let size = count(self.triangles.len().saturating_mul(TRIANGLE_BYTES))?;
        put_u32s(bytes, &[points, 0, 0, 0, 0, triangles, size, 0, 0, 0]);
        self.points.iter().for_each(|point| put_f32s(bytes, point));
        for [a, b, c] in &self.triangles {
            put_u32s(bytes, &[3, *a, *b, *c]);
        }
        Ok(())
    }

    pub(super) fn decode(reader: &mut Reader) -> Result<Self, CodecError> {
        let mut counts = [0; 10];
        for count in &mut counts {
            *count = reader.u32()? as usize;
        }
        let [points, vertices, _, lines, _, triangles, size, strips, _, attributes] = counts;
        if [vertices, lines, strips, attributes] != [0; 4] {
            return Err(CodecError::Field(
                "POLYDATA: only points and triangles are accepted, no vertices, lines, strips or attributes",
            ));
        }
        if triangles.checked_mul(TRIANGLE_BYTES) != Some(size) {
            return Err(CodecError::Field("POLYDATA: its polygons are not all triangles"));
        }
        if points.checked_mul(POINT_BYTES).and_then(|p| p.checked_add(size)) != Some(reader.rest()) {
            return Err(CodecError::Field("POLYDATA: the counts do not fit the length"));
        }
        let mut surface = Self {
            points: Vec::with_capacity(points),
            triangles: Vec::with_capacity(triangles),
        };
        for _ in 0..points {
            surface.points.push(reader.f32s()?);
        }
        for _ in 0..triangles {
            if reader.u32()? != 3 {
                return Err(CodecError::Field("POLYDATA: its polygons are not all triangles"));
            }
            surface.triangles.push([reader.u32()?, reader.u32()?, reader.u32()?]);
        }
        surface.check()?;
        Ok(surface)
    }

    fn check(&self) -> Result<(), CodecError> {
        let outside = |corner: &u32| *corner as usize >= self.points.len();
        match self.triangles.iter().flatten().any(outside) {
            true => Err(CodecError::Field(
                "POLYDATA: a triangle names a point that does not exist",
            )),
            false => Ok(()),
        }
    }
}
