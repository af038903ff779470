//! Segmentations against the label volumes that they were written from, and damaged ones.

use super::super::write::{decimals, item, sequence, string};
use super::write::bytes as written;
use super::*;
use crate::frame::VoxelFrame;
use dicom_core::value::PrimitiveValue;
use dicom_core::{DataElement, VR};
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

const DIMS: [usize; 3] = [7, 5, 6];

/// Returns a gland with a urethra that it also contains, and a rectum two empty planes above;
/// oblique, and left-handed if `is_mirrored`.
pub fn volume(is_mirrored: bool) -> Voxels {
    let turn = Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::new(0.3, -0.2, 0.9)), 0.4);
    let sides = Vector3::new(if is_mirrored { -0.6e-3 } else { 0.6e-3 }, 0.8e-3, 2.5e-3);
    let columns = turn.matrix() * Matrix3::from_diagonal(&sides);
    let label = |n: usize| match [n % DIMS[0], n / DIMS[0] % DIMS[1], n / DIMS[0] / DIMS[1]] {
        [3, 2, 1..=2] => 4,
        [1..=5, 1..=3, 0..=2] => 2,
        [x, 4, 5] if x > 1 => 9,
        _ => 0,
    };
    let labels: Vec<u8> = (0..DIMS.iter().product()).map(label).collect();
    let also = (0..labels.len()).filter(|&n| labels[n] == 4).map(|n| (2, n as u32));
    Voxels {
        dims: DIMS,
        also: also.collect(),
        labels,
        frame: VoxelFrame::new(columns, Vector3::new(0.031, 0.0125, -0.14), "test").unwrap(),
        names: [(2, "Prostate"), (4, "Urethra"), (9, "Rectum")]
            .map(|(l, n)| (l, n.to_owned()))
            .into(),
        overlap: None,
    }
}

/// Returns the elements and the pixels of a written file.
fn parts() -> (Object, Vec<u8>) {
    let file = written(&volume(false), &Identity::new()).unwrap();
    let (object, pixels, _) = checked::read_with_pixels(&file).unwrap();
    (object, pixels.into_owned())
}

fn read_parts((object, pixels): &(Object, Vec<u8>)) -> Result<Voxels, String> {
    of(object, pixels, Endian::Little).map_err(|why| why.to_string())
}

fn short(tag: Tag, value: u16) -> DataElement<InMemDicomObject> {
    DataElement::new(tag, VR::US, PrimitiveValue::from(value))
}

/// Returns the items of a sequence, changed.
fn with(data: &mut InMemDicomObject, tag: Tag, change: impl FnOnce(&mut Vec<InMemDicomObject>)) {
    let mut all = items(data, tag).to_vec();
    change(&mut all);
    data.put(sequence(tag, all));
}

/// Compares names and all labels of each place; the segments are numbered anew.
fn assert_same(read: &Voxels, expected: &Voxels) {
    assert_eq!(
        read.names.values().collect::<Vec<_>>(),
        expected.names.values().collect::<Vec<_>>()
    );
    let places = |v: &Voxels, label: u8| -> Vec<Vector3<f64>> {
        let place = |n: usize| {
            v.frame
                .place_m([n % v.dims[0], n / v.dims[0] % v.dims[1], n / v.dims[0] / v.dims[1]].map(|i| i as f64))
        };
        v.of_label(label).into_iter().map(place).collect()
    };
    for (name, label) in read.names.values().zip(read.names.keys()) {
        let of = expected.names.iter().find(|(_, other)| *other == name).unwrap().0;
        let (mut ours, mut theirs) = (places(read, *label), places(expected, *of));
        assert_eq!(ours.len(), theirs.len(), "{name}");
        // Mirrored axes run through the voxels in another order.
        for all in [&mut ours, &mut theirs] {
            all.sort_by_key(|place| [place.z, place.y, place.x].map(|m| (m * 1e7).round() as i64));
        }
        let off = ours
            .iter()
            .zip(&theirs)
            .map(|(a, b)| (a - b).norm())
            .fold(0.0, f64::max);
        assert!(off < 1e-8, "{name}: {off} m");
    }
}

#[test]
fn written_label_volumes_are_read_again() {
    for is_mirrored in [false, true] {
        let v = volume(is_mirrored);
        let read = read(&written(&v, &Identity::new()).unwrap()).unwrap();
        assert_same(&read, &v);
        assert_eq!(read.also.len(), 2, "the gland has the urethra's voxels too");
        assert!(
            read.overlap.as_ref().unwrap().contains("Prostate (2 of 45 voxels)"),
            "{:?}",
            read.overlap
        );
        assert_eq!(read.frame.warning, None);
        assert_eq!(read.dims, DIMS, "planes without a structure are part of the grid");
    }
}

#[test]
fn frames_may_be_in_any_order() {
    let (mut object, pixels) = parts();
    let area = DIMS[0] * DIMS[1];
    let count = items(&object.data, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).len();
    with(&mut object.data, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE, |frames| {
        frames.reverse()
    });
    let bit = |n: usize| pixels[n / 8] >> (n % 8) & 1;
    let mut turned = vec![0; pixels.len()];
    for n in 0..count * area {
        let from = (count - 1 - n / area) * area + n % area;
        turned[n / 8] |= bit(from) << (n % 8);
    }
    assert_same(&read_parts(&(object, turned)).unwrap(), &volume(false));
}

/// Replaces bits by shares of 200: what was inside becomes `inside`, the rest `outside`.
fn fractional(inside: u8, outside: u8) -> (Object, Vec<u8>) {
    let (mut object, pixels) = parts();
    let count = DIMS[0] * DIMS[1] * items(&object.data, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).len();
    for element in [
        string(tags::SEGMENTATION_TYPE, "FRACTIONAL"),
        string(tags::SEGMENTATION_FRACTIONAL_TYPE, "PROBABILITY"),
        short(tags::MAXIMUM_FRACTIONAL_VALUE, 200),
        short(tags::BITS_ALLOCATED, 8),
        short(tags::BITS_STORED, 8),
        short(tags::HIGH_BIT, 7),
    ] {
        object.data.put(element);
    }
    let share = |n: usize| {
        if pixels[n / 8] >> (n % 8) & 1 == 1 {
            inside
        } else {
            outside
        }
    };
    (object, (0..count).map(share).collect())
}

#[test]
fn fractions_count_from_half_on_with_a_note() {
    let read = read_parts(&fractional(100, 99)).unwrap();
    assert_same(&read, &volume(false));
    let note = read.frame.warning.unwrap();
    assert!(
        note.contains("half of 200") && note.contains("210 lie between none and all"),
        "{note}"
    );
    let empty = read_parts(&fractional(99, 0)).unwrap();
    assert!(empty.present().is_empty() && empty.frame.warning.unwrap().contains("\"Urethra\" has no voxel"));
    assert!(
        read_parts(&fractional(201, 0))
            .unwrap_err()
            .contains("MaximumFractionalValue")
    );
}

#[test]
fn label_maps_have_their_segments_as_pixels() {
    let v = volume(false);
    let (mut object, _) = parts();
    let area = DIMS[0] * DIMS[1];
    for element in [
        string(tags::SEGMENTATION_TYPE, "LABELMAP"),
        short(tags::BITS_ALLOCATED, 16),
        short(tags::BITS_STORED, 16),
        short(tags::HIGH_BIT, 15),
        string(tags::NUMBER_OF_FRAMES, "6"),
    ] {
        object.data.put(element);
    }
    let place = |k: usize| {
        let corner: Vector3<f64> = stylet_anatomy::ras_from_lps(v.frame.place_m([0.0, 0.0, k as f64])) * 1e3;
        let place = item([decimals(tags::IMAGE_POSITION_PATIENT, corner.as_slice())]);
        item([sequence(tags::PLANE_POSITION_SEQUENCE, vec![place])])
    };
    object.data.put(sequence(
        tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE,
        (0..6).map(place).collect(),
    ));
    let number = |label: u8| [0, 0, 1, 0, 2, 0, 0, 0, 0, 3][usize::from(label)];
    let pixels: Vec<u8> = v.labels.iter().flat_map(|&label| [number(label), 0]).collect();
    assert_eq!(pixels.len(), 2 * 6 * area);
    let expected = Voxels { also: Vec::new(), ..v };
    let mut parts = (object, pixels);
    assert_same(&read_parts(&parts).unwrap(), &expected);
    parts.1[1] = 1;
    assert!(read_parts(&parts).unwrap_err().contains("segment 256"));
}

/// Changes one thing; returns the error, or all notes.
fn changed(change: impl FnOnce(&mut InMemDicomObject)) -> Result<String, String> {
    let mut parts = parts();
    change(&mut parts.0.data);
    read_parts(&parts).map(|v| v.frame.warning.unwrap_or_default())
}

fn in_segment(data: &mut InMemDicomObject, n: usize, change: impl FnOnce(&mut InMemDicomObject)) {
    with(data, tags::SEGMENT_SEQUENCE, |all| change(&mut all[n]));
}

fn in_measures(data: &mut InMemDicomObject, change: impl FnOnce(&mut InMemDicomObject)) {
    with(data, tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE, |shared| {
        with(&mut shared[0], tags::PIXEL_MEASURES_SEQUENCE, |all| change(&mut all[0]));
    });
}

fn in_frame(data: &mut InMemDicomObject, n: usize, group: Tag, element: DataElement<InMemDicomObject>) {
    with(data, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE, |frames| {
        with(&mut frames[n], group, |all| {
            all[0].put(element);
        });
    });
}

#[test]
fn what_does_not_fit_is_refused_with_its_attribute() {
    let place = tags::PLANE_POSITION_SEQUENCE;
    let segment = tags::SEGMENT_IDENTIFICATION_SEQUENCE;
    let refused = [
        (
            "SegmentationType",
            changed(|data| {
                data.remove_element(tags::SEGMENTATION_TYPE);
            }),
        ),
        (
            "SegmentationType",
            changed(|data| {
                data.put(string(tags::SEGMENTATION_TYPE, "SURFACE"));
            }),
        ),
        (
            "BitsAllocated",
            changed(|data| {
                data.put(string(tags::SEGMENTATION_TYPE, "LABELMAP"));
            }),
        ),
        (
            "Rows",
            changed(|data| {
                data.put(short(tags::ROWS, 4));
            }),
        ),
        (
            "SegmentNumber",
            changed(|data| {
                in_segment(data, 0, |one| {
                    one.put(short(tags::SEGMENT_NUMBER, 2));
                })
            }),
        ),
        (
            "SegmentSequence",
            changed(|data| in_frame(data, 0, segment, short(tags::REFERENCED_SEGMENT_NUMBER, 8))),
        ),
        // The frame of the urethra in this plane is there already.
        (
            "the place and the segment",
            changed(|data| in_frame(data, 1, segment, short(tags::REFERENCED_SEGMENT_NUMBER, 2))),
        ),
        (
            "ImagePositionPatient",
            changed(|data| in_frame(data, 1, place, string(tags::IMAGE_POSITION_PATIENT, ""))),
        ),
        // 1 mm along the rows.
        (
            "multiples of",
            changed(|data| {
                in_frame(
                    data,
                    1,
                    place,
                    decimals(tags::IMAGE_POSITION_PATIENT, &[-30.0, -12.5, -140.0]),
                )
            }),
        ),
        (
            "SpacingBetweenSlices",
            changed(|data| {
                in_measures(data, |one| {
                    one.put(string(tags::SPACING_BETWEEN_SLICES, "5"));
                })
            }),
        ),
        (
            "PixelSpacing",
            changed(|data| {
                in_measures(data, |one| {
                    one.remove_element(tags::PIXEL_SPACING);
                })
            }),
        ),
    ];
    for (n, (part, answer)) in refused.into_iter().enumerate() {
        let why = answer.expect_err(part);
        assert!(why.contains(part), "{n}: {why} without {part}");
    }
}

#[test]
fn what_may_be_meant_otherwise_is_noted() {
    let noted = [
        (
            "no two of its planes are next to each other",
            changed(|data| {
                in_measures(data, |one| {
                    one.put(string(tags::SPACING_BETWEEN_SLICES, "1.25"));
                })
            }),
        ),
        (
            "SpacingBetweenSlices (0018,0088) is missing",
            changed(|data| {
                in_measures(data, |one| {
                    one.remove_element(tags::SPACING_BETWEEN_SLICES);
                    one.put(string(tags::SLICE_THICKNESS, "1"));
                })
            }),
        ),
        (
            "it is called \"Prostate\"",
            changed(|data| {
                in_segment(data, 0, |one| {
                    one.remove_element(tags::SEGMENT_LABEL);
                })
            }),
        ),
        (
            "is called \"Prostate (Segment_1)\"",
            changed(|data| {
                in_segment(data, 0, |one| {
                    one.put(string(tags::SEGMENT_LABEL, "Segment_1"));
                })
            }),
        ),
        (
            "\"Fat\" is of type \"Rectum\"",
            changed(|data| {
                in_segment(data, 2, |one| {
                    one.put(string(tags::SEGMENT_LABEL, "Fat"));
                })
            }),
        ),
    ];
    let without = (
        "DimensionIndexSequence (0020,9222) has no",
        changed(|data| {
            data.remove_element(tags::DIMENSION_INDEX_SEQUENCE);
        }),
    );
    // Of the urethra, in a plane where the rectum has no frame.
    let other = |data: &mut InMemDicomObject| {
        let segment = tags::SEGMENT_IDENTIFICATION_SEQUENCE;
        in_frame(data, 3, segment, short(tags::REFERENCED_SEGMENT_NUMBER, 3));
    };
    let contradicted = ("DimensionIndexValues (0020,9157)", changed(other));
    for (part, answer) in noted.into_iter().chain([without, contradicted]) {
        let note = answer.expect(part);
        assert!(note.contains(part), "{note} without {part}");
    }
    assert_eq!(changed(|_| ()), Ok(String::new()));
}
