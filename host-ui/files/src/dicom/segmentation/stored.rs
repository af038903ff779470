//! The pixels of a segmentation: bits, fractions or labels.

use super::super::super::element::{Endian, short};
use super::super::values::{name, needed, number, text};
use crate::error::{ContentError, invalid};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use std::collections::BTreeMap;

/// Pixels of all frames.
pub struct Stored<'a> {
    pixels: &'a [u8],
    kind: Kind,
    /// Number of pixels.
    count: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// A bit for each pixel, the lowest first; frames follow each other within a byte.
    Binary,
    /// A share of `most` for each pixel.
    Fractional { most: u8 },
    /// A segment for each pixel, of one byte or two.
    Labels { bytes: usize, endian: Endian },
}

impl<'a> Stored<'a> {
    /// Takes the pixels of `frames` frames of `area` pixels.
    pub fn of(
        data: &InMemDicomObject,
        pixels: &'a [u8],
        endian: Endian,
        area: usize,
        frames: usize,
    ) -> Result<Self, ContentError> {
        let is = |tag, expected: &[f64]| {
            let value = number(data, tag)?.unwrap_or_default();
            match expected.contains(&value) {
                true => Ok(value),
                false => Err(invalid!("{} is {value}, not {}", name(tag), expected[0])),
            }
        };
        is(tags::SAMPLES_PER_PIXEL, &[1.0])?;
        is(tags::PIXEL_REPRESENTATION, &[0.0])?;
        let bits = |expected: &[f64]| {
            let bits = is(tags::BITS_ALLOCATED, expected)?;
            is(tags::BITS_STORED, &[bits])?;
            is(tags::HIGH_BIT, &[bits - 1.0])?;
            Ok::<_, ContentError>(bits as usize)
        };
        let missing = || invalid!("{} is missing", name(tags::SEGMENTATION_TYPE));
        let kind = match text(data, tags::SEGMENTATION_TYPE).ok_or_else(missing)?.as_str() {
            "BINARY" => Kind::Binary,
            "FRACTIONAL" => Kind::Fractional {
                most: needed(data, tags::MAXIMUM_FRACTIONAL_VALUE, 1.0, 255.0)? as u8,
            },
            "LABELMAP" => Kind::Labels {
                bytes: bits(&[8.0, 16.0])? / 8,
                endian,
            },
            other => {
                return Err(invalid!(
                    "{} is \"{}\"; BINARY, FRACTIONAL and LABELMAP are read",
                    name(tags::SEGMENTATION_TYPE),
                    short(other)
                ));
            }
        };
        let count = area.saturating_mul(frames);
        let needed = match kind {
            Kind::Binary => count.div_ceil(bits(&[1.0])? * 8),
            Kind::Fractional { .. } => count.saturating_mul(bits(&[8.0])? / 8),
            Kind::Labels { bytes, .. } => count.saturating_mul(bytes),
        };
        // One byte more makes an odd length even.
        if pixels.len() < needed || pixels.len() > needed.next_multiple_of(2) {
            return Err(invalid!(
                "its {frames} frames of {area} pixels need {needed} bytes, and {} are there: it is truncated, or \
                 NumberOfFrames, Rows or Columns are not those of its pixels",
                pixels.len()
            ));
        }
        if endian == Endian::Big && kind == Kind::Binary {
            return Err(
                "its pixels are single bits in big endian, which programs write in different orders; export it as explicit VR little endian".into(),
            );
        }
        let stored = Self { pixels, kind, count };
        if let Kind::Fractional { most } = kind
            && stored.fractions().any(|value| *value > most)
        {
            return Err(invalid!(
                "it has values over the {most} of {}",
                name(tags::MAXIMUM_FRACTIONAL_VALUE)
            ));
        }
        Ok(stored)
    }

    /// Returns whether each frame is of one segment.
    pub fn of_segments(&self) -> bool {
        !matches!(self.kind, Kind::Labels { .. })
    }

    /// Returns whether a pixel is in the segment of its frame.
    pub fn is_inside(&self, pixel: usize) -> bool {
        match self.kind {
            Kind::Binary => self.pixels[pixel / 8] >> (pixel % 8) & 1 == 1,
            Kind::Fractional { most } => u16::from(self.pixels[pixel]) * 2 >= u16::from(most),
            Kind::Labels { .. } => false,
        }
    }

    /// Returns the label of a pixel, 0 if it has none.
    pub fn label(&self, pixel: usize) -> u8 {
        u8::try_from(self.number(pixel)).unwrap_or_default()
    }

    /// Refuses labels that no segment has.
    pub fn check_labels(&self, names: &BTreeMap<u8, String>) -> Result<(), ContentError> {
        let is_known =
            |number: &u16| *number == 0 || u8::try_from(*number).is_ok_and(|label| names.contains_key(&label));
        match (0..self.count)
            .map(|pixel| self.number(pixel))
            .find(|number| !is_known(number))
        {
            None => Ok(()),
            Some(other) => Err(invalid!(
                "it has pixels of segment {other}, which {} does not describe",
                name(tags::SEGMENT_SEQUENCE)
            )),
        }
    }

    /// Returns a remark on voxels of which a part is inside.
    pub fn remark(&self) -> Option<String> {
        let Kind::Fractional { most } = self.kind else {
            return None;
        };
        let between = self.fractions().filter(|value| **value != 0 && **value != most).count();
        Some(format!(
            "its segments are fractional ({}): a voxel belongs to a segment from half of {most} ({}) on; {between} lie between none and all",
            name(tags::SEGMENTATION_TYPE),
            name(tags::MAXIMUM_FRACTIONAL_VALUE)
        ))
    }

    fn number(&self, pixel: usize) -> u16 {
        match self.kind {
            Kind::Labels { bytes: 2, endian } => {
                let two = [self.pixels[2 * pixel], self.pixels[2 * pixel + 1]];
                match endian {
                    Endian::Little => u16::from_le_bytes(two),
                    Endian::Big => u16::from_be_bytes(two),
                }
            }
            _ => self.pixels[pixel].into(),
        }
    }

    fn fractions(&self) -> impl Iterator<Item = &u8> {
        self.pixels[..self.count].iter()
    }
}
