//! Pixels of an image or a dose, and the plane of an image in the patient.

use super::super::Progress;
use super::super::element::{Element, Endian, Sink, read_values, short};
use super::values::{given, items, name, needed, number, text};
use crate::error::{ContentError, invalid};
use dicom_core::Tag;
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use nalgebra::Vector3;

/// Place and directions of an image (LPS, mm).
#[derive(Clone, Debug)]
pub struct Plane {
    /// Centre of the first pixel.
    pub corner: Vector3<f64>,
    /// Directions from column to column, and from row to row.
    pub directions: [Vector3<f64>; 2],
    /// Distances of columns, and of rows.
    pub pitch: [f64; 2],
}

impl Plane {
    /// Reads position, orientation and spacing, which enhanced images have in three groups.
    pub fn of(
        place: &InMemDicomObject,
        turn: &InMemDicomObject,
        spacing: &InMemDicomObject,
    ) -> Result<Self, ContentError> {
        let corner: [f64; 3] = given(place, tags::IMAGE_POSITION_PATIENT)?;
        let [a, b, c, d, e, f] = given(turn, tags::IMAGE_ORIENTATION_PATIENT)?;
        let [between_rows, between_columns] = given(spacing, tags::PIXEL_SPACING)?;
        Ok(Self {
            corner: corner.into(),
            directions: [Vector3::new(a, b, c), Vector3::new(d, e, f)],
            pitch: [between_columns, between_rows],
        })
    }

    /// Returns the steps from column to column, and from row to row.
    pub fn steps(&self) -> [Vector3<f64>; 2] {
        [0, 1].map(|n| self.directions[n] * self.pitch[n])
    }
}

/// Most frames of one file.
const MAX_FRAMES: f64 = 65_535.0;

/// Attributes of one frame of several in a file: its own, and those of all frames.
pub struct Groups<'a> {
    /// Its own attributes.
    pub own: &'a InMemDicomObject,
    shared: Option<&'a InMemDicomObject>,
}

impl<'a> Groups<'a> {
    /// Returns the attributes of every frame.
    pub fn of(data: &'a InMemDicomObject) -> Result<Vec<Self>, ContentError> {
        let count = needed(data, tags::NUMBER_OF_FRAMES, 1.0, MAX_FRAMES)? as usize;
        let own = items(data, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE);
        if own.len() != count {
            return Err(invalid!(
                "it says {count} frames and describes {}; export it again",
                own.len()
            ));
        }
        let shared = items(data, tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE).first();
        Ok(own.iter().map(|own| Self { own, shared }).collect())
    }

    /// Returns a group of attributes.
    pub fn get(&self, sequence: Tag) -> Option<&'a InMemDicomObject> {
        let of = |groups: &'a InMemDicomObject| items(groups, sequence).first();
        of(self.own).or_else(|| self.shared.and_then(of))
    }

    /// Returns place and directions of the frame.
    pub fn plane(&self) -> Result<Plane, ContentError> {
        let nothing = InMemDicomObject::new_empty();
        let group = |sequence| self.get(sequence).unwrap_or(&nothing);
        Plane::of(
            group(tags::PLANE_POSITION_SEQUENCE),
            group(tags::PLANE_ORIENTATION_SEQUENCE),
            group(tags::PIXEL_MEASURES_SEQUENCE),
        )
    }
}

/// Returns the numbers of columns and rows.
pub fn size(data: &InMemDicomObject) -> Result<[usize; 2], ContentError> {
    let [columns, rows] = [tags::COLUMNS, tags::ROWS].map(|tag| needed(data, tag, 1.0, 65_535.0));
    Ok([columns? as usize, rows? as usize])
}

/// Storage of a pixel.
pub struct Pixel {
    element: Element,
    /// Significant bits, and whether the highest of them is a sign.
    stored: u32,
    is_signed: bool,
}

impl Pixel {
    /// Reads the storage of greys.
    pub fn of(data: &InMemDicomObject) -> Result<Self, ContentError> {
        let samples = number(data, tags::SAMPLES_PER_PIXEL)?.unwrap_or(1.0);
        let kind = text(data, tags::PHOTOMETRIC_INTERPRETATION).unwrap_or_else(|| "MONOCHROME2".to_owned());
        if samples != 1.0 || kind != "MONOCHROME2" {
            return Err(invalid!(
                "its pixels are {} with {samples} values each; images with one grey a pixel (MONOCHROME2) are read",
                short(&kind)
            ));
        }
        let bits = needed(data, tags::BITS_ALLOCATED, 1.0, 64.0)?;
        let element = match bits as u32 {
            8 => Element::U8,
            16 => Element::U16,
            32 => Element::U32,
            _ => {
                return Err(invalid!("its pixels have {bits} bits; 8, 16 and 32 are read"));
            }
        };
        let stored = needed(data, tags::BITS_STORED, 1.0, bits)?;
        let high = number(data, tags::HIGH_BIT)?.unwrap_or(stored - 1.0);
        if high != stored - 1.0 {
            return Err(invalid!(
                "{stored} of its {bits} bits count, up to bit {high}; images whose bits begin at the lowest are read"
            ));
        }
        Ok(Self {
            element,
            stored: stored as u32,
            is_signed: needed(data, tags::PIXEL_REPRESENTATION, 0.0, 1.0)? == 1.0,
        })
    }

    /// Returns the bytes of one pixel.
    pub fn bytes(&self) -> usize {
        self.element.bytes()
    }

    /// Refuses pixels of which not all bits count.
    pub fn whole(self) -> Result<Self, ContentError> {
        let bits = 8 * self.bytes() as u32;
        match self.stored == bits {
            true => Ok(self),
            false => Err(invalid!(
                "{} is {}; doses of {bits} bits have {bits}",
                name(tags::BITS_STORED),
                self.stored
            )),
        }
    }

    /// Returns the stored numbers of all pixels; `count` of them must be there.
    pub fn values(&self, pixels: &[u8], endian: Endian, count: usize) -> Result<Vec<f64>, ContentError> {
        // OW swaps the bytes of each word of 16 bits (PS3.5 6.2); other programs swap all four bytes.
        if self.element == Element::U32 && endian == Endian::Big {
            return Err(
                "its pixels have 32 bits in big endian, which programs write in different orders; export it as explicit VR little endian"
                    .into(),
            );
        }
        let (needed, have) = (count * self.bytes(), pixels.len());
        // One byte more makes an odd length even.
        if have < needed || have > needed.next_multiple_of(2) {
            let why = match have < needed {
                true => "it is truncated; copy or export it again",
                false => "NumberOfFrames, Rows or Columns are not those of its pixels",
            };
            return Err(invalid!(
                "{count} pixels need {needed} bytes, and {have} are there: {why}"
            ));
        }
        let progress = Progress::default();
        let raw = read_values(pixels, self.element, endian, count, [1.0, 0.0], Sink::exact(&progress))?;
        // Bits above the significant ones may hold overlays.
        let kept = (1_u64 << self.stored) - 1;
        let sign = 1_u64 << (self.stored - 1);
        let value = |raw: f64| {
            let bits = raw as u64 & kept;
            match self.is_signed && bits & sign != 0 {
                true => bits as f64 - (kept + 1) as f64,
                false => bits as f64,
            }
        };
        Ok(raw.into_iter().map(value).collect())
    }
}
