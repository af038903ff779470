//! DICOM Segmentation: label maps with a frame for each segment and plane, or with labels as pixels.

mod segments;
mod stored;
pub mod write;

use super::super::overlap;
use super::super::volume::Voxels;
use super::images::{self, Slice};
use super::pixels::{self, Groups};
use super::values::{items, name, needed, text};
use super::{Identity, Object, checked};
use crate::element::Endian;
use crate::error::{ContentError, invalid};
use dicom_core::Tag;
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;
use segments::Segments;
use std::collections::{BTreeMap, BTreeSet};
use stored::Stored;

/// Returns whether the class is a segmentation of voxels.
pub fn is_segmentation(sop_class: &str) -> bool {
    [uids::SEGMENTATION_STORAGE, uids::LABEL_MAP_SEGMENTATION_STORAGE].contains(&sop_class)
}

/// Reads the bytes of a file.
pub fn read(bytes: &[u8]) -> Result<Voxels, ContentError> {
    let (object, pixels, endian) = checked::read_with_pixels(bytes)?;
    of(&object, &pixels, endian)
}

pub(super) fn of(object: &Object, pixels: &[u8], endian: Endian) -> Result<Voxels, ContentError> {
    let data = &object.data;
    let size = pixels::size(data)?;
    let area = size[0] * size[1];
    let frames = Groups::of(data)?;
    let Segments { names, mut notes } = Segments::of(data)?;
    let stored = Stored::of(data, pixels, endian, area, frames.len())?;
    let slices: Result<Vec<Slice>, ContentError> = frames.iter().map(|frame| slice(object, frame, size)).collect();
    let slices = slices.map_err(|why| why.within("a frame"))?;
    let millimetres = |tag| of_all(&frames, tags::PIXEL_MEASURES_SEQUENCE, tag);
    let planes = images::sparse(
        &slices,
        millimetres(tags::SPACING_BETWEEN_SLICES)?,
        millimetres(tags::SLICE_THICKNESS)?,
    )?;
    notes.extend(planes.notes);
    notes.extend(object.loss.clone());
    let grid = planes.grid;
    let count = area * grid.dims[2];
    // The frames of each plane with their segments; without one, the pixels name the segment.
    let mut of_plane: Vec<Vec<(Option<u8>, usize)>> = vec![Vec::new(); grid.dims[2]];
    for (n, (frame, plane)) in frames.iter().zip(&planes.planes).enumerate() {
        let label = stored.of_segments().then(|| segment(frame, &names)).transpose();
        let label = label.map_err(|why| why.within(format_args!("frame {}", n + 1)))?;
        if of_plane[*plane].iter().any(|(other, _)| *other == label) {
            return Err(invalid!(
                "frame {} has the place and the segment of another one; export it again",
                n + 1
            ));
        }
        of_plane[*plane].push((label, n));
    }
    match stored.of_segments() {
        true if names.len() > 1 => notes.extend(numbered_otherwise(data, &frames)),
        true => {}
        false => stored.check_labels(&names)?,
    }
    notes.extend(stored.remark());
    let of_voxel = |voxel: usize, found: &mut Vec<u8>| {
        let (plane, pixel) = (voxel / area, voxel % area);
        let labels = of_plane[plane].iter().map(|(label, frame)| match label {
            Some(label) if stored.is_inside(frame * area + pixel) => *label,
            Some(_) => 0,
            None => stored.label(frame * area + pixel),
        });
        found.extend(labels.filter(|label| *label != 0));
    };
    let voxel_m3 = grid.frame.spacing_m.iter().product();
    let (labels, also, lost) = overlap::smallest_wins(count, voxel_m3, &names, of_voxel);
    let mut voxels = Voxels {
        dims: grid.dims,
        labels,
        frame: grid.frame,
        names,
        also,
        overlap: lost,
    };
    let present = voxels.present();
    let empty = voxels.names.iter().filter(|(label, _)| !present.contains(label));
    notes.extend(empty.map(|(label, name)| format!("its segment {label} \"{name}\" has no voxel")));
    voxels.names.retain(|label, _| present.contains(label));
    Ok(overlap::with_warning(
        voxels,
        (!notes.is_empty()).then(|| notes.join("; ")),
    ))
}

fn slice(object: &Object, frame: &Groups, size: [usize; 2]) -> Result<Slice, ContentError> {
    let series = text(&object.data, tags::SERIES_INSTANCE_UID).unwrap_or_default();
    Ok(Slice::new((series, Identity::of(object)), &frame.plane()?, size))
}

/// Returns a number of a group that all frames agree on; `None` if no frame has it.
fn of_all(frames: &[Groups], group: Tag, tag: Tag) -> Result<Option<f64>, ContentError> {
    let nothing = InMemDicomObject::new_empty();
    let mut found = Vec::new();
    for frame in frames {
        let data = frame.get(group).unwrap_or(&nothing);
        if text(data, tag).is_some() {
            found.push(needed(data, tag, 0.0, 1e4)?);
        }
    }
    let first = found.first().copied();
    match first.is_some() && (found.len() != frames.len() || found.iter().any(|other| Some(*other) != first)) {
        true => Err(invalid!("its frames differ in {}", name(tag))),
        false => Ok(first),
    }
}

/// Returns the segment of a frame.
fn segment(frame: &Groups, names: &BTreeMap<u8, String>) -> Result<u8, ContentError> {
    let nothing = InMemDicomObject::new_empty();
    let of = frame.get(tags::SEGMENT_IDENTIFICATION_SEQUENCE).unwrap_or(&nothing);
    let number = needed(of, tags::REFERENCED_SEGMENT_NUMBER, 1.0, 255.0)?;
    let number = number as u8;
    match names.contains_key(&number) && items(frame.own, tags::SEGMENT_IDENTIFICATION_SEQUENCE).len() < 2 {
        true => Ok(number),
        false => Err(invalid!(
            "{} is {number}, which {} does not describe",
            name(tags::REFERENCED_SEGMENT_NUMBER),
            name(tags::SEGMENT_SEQUENCE)
        )),
    }
}

/// Returns a remark unless the index of each frame among the segments is that of its segment's other
/// frames; a number that was changed would be found by nothing else.
fn numbered_otherwise(data: &InMemDicomObject, frames: &[Groups]) -> Option<String> {
    let nothing = InMemDicomObject::new_empty();
    let pointer = |item: &InMemDicomObject| item.get(tags::DIMENSION_INDEX_POINTER)?.value().to_tag().ok();
    let dimensions = items(data, tags::DIMENSION_INDEX_SEQUENCE);
    let Some(at) = dimensions
        .iter()
        .position(|item| pointer(item) == Some(tags::REFERENCED_SEGMENT_NUMBER))
    else {
        return Some(format!(
            "{} has no {}, so the segments of its frames are not compared with their indices",
            name(tags::DIMENSION_INDEX_SEQUENCE),
            name(tags::REFERENCED_SEGMENT_NUMBER)
        ));
    };
    let number = |frame: &Groups| {
        let index = frame.get(tags::FRAME_CONTENT_SEQUENCE).unwrap_or(&nothing);
        let index = index
            .get(tags::DIMENSION_INDEX_VALUES)
            .and_then(|values| values.to_multi_int::<u32>().ok());
        let segment = frame.get(tags::SEGMENT_IDENTIFICATION_SEQUENCE).unwrap_or(&nothing);
        (
            index.and_then(|index| index.get(at).copied()),
            text(segment, tags::REFERENCED_SEGMENT_NUMBER),
        )
    };
    let pairs: BTreeSet<_> = frames.iter().map(number).collect();
    let (indices, segments): (BTreeSet<_>, BTreeSet<_>) = pairs.iter().cloned().unzip();
    let is_one_to_one = indices.len() == pairs.len() && segments.len() == pairs.len() && !indices.contains(&None);
    (!is_one_to_one).then(|| {
        format!(
            "{} of its frames are missing or contradict {}, which counts",
            name(tags::DIMENSION_INDEX_VALUES),
            name(tags::REFERENCED_SEGMENT_NUMBER)
        )
    })
}

#[cfg(test)]
pub(super) mod tests;
