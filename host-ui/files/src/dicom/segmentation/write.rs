//! Structures of a label volume as a Segmentation of bits: one frame for each structure and each plane that it is in.

use super::super::super::volume::Voxels;
use super::super::write::{bytes as file_bytes, common, decimals, item, now, sequence, string, whole};
use super::super::{Identity, SEGMENTATION, new_uid};
use super::segments::{Code, codes_of};
use crate::error::{ContentError, invalid};
use dicom_core::value::PrimitiveValue;
use dicom_core::{DataElement, Tag, VR};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use nalgebra::Vector3;
use stylet_anatomy::ras_from_lps;

/// Most frames: what NumberOfFrames is read up to.
const MAX_FRAMES: usize = 65_535;

type Element = DataElement<InMemDicomObject>;

/// Returns the bytes of the file; overlaps are kept.
pub fn bytes(v: &Voxels, identity: &Identity) -> Result<Vec<u8>, ContentError> {
    let present = v.present();
    if present.is_empty() {
        return Err("every voxel is 0, so there is no structure to write".into());
    }
    let [columns, rows, _] = v.dims;
    let name_of = |label: u8| v.names.get(&label).cloned().unwrap_or_else(|| format!("label {label}"));
    // Segments are numbered from 1 in the order of the labels (PS3.3 C.8.20.2).
    let segments = present.iter().zip(1_u16..);
    let frames = Frames::of(v, &present);
    let count = frames.places.len();
    if count > MAX_FRAMES || columns.max(rows) > usize::from(u16::MAX) {
        return Err(invalid!(
            "it would have {count} frames of {columns} x {rows} pixels; at most {MAX_FRAMES} frames are written"
        ));
    }
    let (date, time) = now();
    let organization = new_uid();
    let mut object = common(SEGMENTATION, "SEG", identity);
    for element in [
        string(tags::SERIES_DESCRIPTION, "Segmentation"),
        string(tags::DEVICE_SERIAL_NUMBER, "0"),
        string(tags::INSTANCE_NUMBER, "1"),
        string(tags::CONTENT_DATE, &date),
        string(tags::CONTENT_TIME, &time),
        texts(tags::IMAGE_TYPE, &["DERIVED", "PRIMARY"]),
        string(tags::CONTENT_LABEL, "SEGMENTATION"),
        string(tags::CONTENT_DESCRIPTION, ""),
        string(tags::CONTENT_CREATOR_NAME, ""),
        short(tags::SAMPLES_PER_PIXEL, 1),
        string(tags::PHOTOMETRIC_INTERPRETATION, "MONOCHROME2"),
        short(tags::ROWS, rows as u16),
        short(tags::COLUMNS, columns as u16),
        short(tags::BITS_ALLOCATED, 1),
        short(tags::BITS_STORED, 1),
        short(tags::HIGH_BIT, 0),
        short(tags::PIXEL_REPRESENTATION, 0),
        string(tags::LOSSY_IMAGE_COMPRESSION, "00"),
        string(tags::SEGMENTATION_TYPE, "BINARY"),
        string(tags::SEGMENTS_OVERLAP, if v.also.is_empty() { "NO" } else { "YES" }),
        sequence(
            tags::SEGMENT_SEQUENCE,
            segments
                .map(|(label, number)| segment(number, &name_of(*label)))
                .collect(),
        ),
        sequence(
            tags::DIMENSION_ORGANIZATION_SEQUENCE,
            vec![item([string(tags::DIMENSION_ORGANIZATION_UID, &organization)])],
        ),
        sequence(tags::DIMENSION_INDEX_SEQUENCE, dimensions(&organization)),
        sequence(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE, vec![shared(v)]),
        whole(tags::NUMBER_OF_FRAMES, count),
        sequence(
            tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE,
            frames
                .places
                .iter()
                .map(|(number, plane)| own(v, *number, *plane))
                .collect(),
        ),
        DataElement::new(tags::PIXEL_DATA, VR::OB, PrimitiveValue::U8(frames.pixels.into())),
    ] {
        object.put(element);
    }
    file_bytes(object)
}

/// Frames in the order of the segments, and of the planes of each.
struct Frames {
    /// Segment and plane of each frame.
    places: Vec<(u16, usize)>,
    /// Eight pixels a byte, the first lowest, of an even length; frames follow each other within a byte.
    pixels: Vec<u8>,
}

impl Frames {
    fn of(v: &Voxels, present: &[u8]) -> Self {
        let area = v.dims[0] * v.dims[1];
        let (mut places, mut pixels) = (Vec::new(), Vec::new());
        for (label, number) in present.iter().zip(1_u16..) {
            let voxels = v.of_label(*label);
            for of_plane in voxels.chunk_by(|a, b| a / area == b / area) {
                let begin = places.len() * area;
                pixels.resize((begin + area).div_ceil(8), 0);
                for bit in of_plane.iter().map(|voxel| begin + voxel % area) {
                    pixels[bit / 8] |= 1 << (bit % 8);
                }
                places.push((number, of_plane[0] / area));
            }
        }
        pixels.resize(pixels.len().next_multiple_of(2), 0);
        Self { places, pixels }
    }
}

fn short(tag: Tag, value: u16) -> Element {
    DataElement::new(tag, VR::US, PrimitiveValue::from(value))
}

fn texts(tag: Tag, values: &[&str]) -> Element {
    let values = values.iter().map(|value| (*value).to_owned()).collect();
    DataElement::new(tag, VR::CS, PrimitiveValue::Strs(values))
}

fn coded(tag: Tag, (value, _, meaning): Code) -> Element {
    let code = item([
        string(tags::CODE_VALUE, value),
        string(tags::CODING_SCHEME_DESIGNATOR, "SCT"),
        string(tags::CODE_MEANING, meaning),
    ]);
    sequence(tag, vec![code])
}

fn segment(number: u16, name: &str) -> InMemDicomObject {
    let [category, kind] = codes_of(name);
    item([
        coded(tags::SEGMENTED_PROPERTY_CATEGORY_CODE_SEQUENCE, category),
        short(tags::SEGMENT_NUMBER, number),
        string(tags::SEGMENT_LABEL, name),
        // Who or what drew it is not known.
        string(tags::SEGMENT_ALGORITHM_TYPE, "SEMIAUTOMATIC"),
        string(tags::SEGMENT_ALGORITHM_NAME, "label map converted by Stylet"),
        coded(tags::SEGMENTED_PROPERTY_TYPE_CODE_SEQUENCE, kind),
    ])
}

/// Returns what the frames are ordered by: segment, then place.
fn dimensions(organization: &str) -> Vec<InMemDicomObject> {
    let pointer = |tag, value: Tag| DataElement::new(tag, VR::AT, PrimitiveValue::Tags(vec![value].into()));
    let dimension = |(attribute, group, shown): (Tag, Tag, &str)| {
        item([
            string(tags::DIMENSION_ORGANIZATION_UID, organization),
            pointer(tags::DIMENSION_INDEX_POINTER, attribute),
            pointer(tags::FUNCTIONAL_GROUP_POINTER, group),
            string(tags::DIMENSION_DESCRIPTION_LABEL, shown),
        ])
    };
    let of_segment = (
        tags::REFERENCED_SEGMENT_NUMBER,
        tags::SEGMENT_IDENTIFICATION_SEQUENCE,
        "Segment",
    );
    let of_place = (tags::IMAGE_POSITION_PATIENT, tags::PLANE_POSITION_SEQUENCE, "Position");
    [of_segment, of_place].map(dimension).to_vec()
}

/// Returns what all frames have in common: directions and sides of a voxel.
fn shared(v: &Voxels) -> InMemDicomObject {
    let along = |a: usize| -> Vector3<f64> { ras_from_lps(v.frame.directions.column(a).into()) };
    let directions: Vec<f64> = along(0).iter().chain(along(1).iter()).copied().collect();
    let [columns, rows, planes] = v.frame.spacing_m.map(|m| m * 1e3);
    let measures = item([
        decimals(tags::SLICE_THICKNESS, &[planes]),
        decimals(tags::SPACING_BETWEEN_SLICES, &[planes]),
        decimals(tags::PIXEL_SPACING, &[rows, columns]),
    ]);
    let orientation = item([decimals(tags::IMAGE_ORIENTATION_PATIENT, &directions)]);
    item([
        sequence(tags::PIXEL_MEASURES_SEQUENCE, vec![measures]),
        sequence(tags::PLANE_ORIENTATION_SEQUENCE, vec![orientation]),
    ])
}

/// Returns segment and place of a frame.
fn own(v: &Voxels, number: u16, plane: usize) -> InMemDicomObject {
    let corner: Vector3<f64> = ras_from_lps(v.frame.place_m([0.0, 0.0, plane as f64])) * 1e3;
    let index = PrimitiveValue::U32(vec![u32::from(number), plane as u32 + 1].into());
    let content = item([DataElement::new(tags::DIMENSION_INDEX_VALUES, VR::UL, index)]);
    let place = item([decimals(tags::IMAGE_POSITION_PATIENT, corner.as_slice())]);
    item([
        sequence(tags::FRAME_CONTENT_SEQUENCE, vec![content]),
        sequence(tags::PLANE_POSITION_SEQUENCE, vec![place]),
        sequence(
            tags::SEGMENT_IDENTIFICATION_SEQUENCE,
            vec![item([short(tags::REFERENCED_SEGMENT_NUMBER, number)])],
        ),
    ])
}
