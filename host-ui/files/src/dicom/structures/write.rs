//! Structures as RT Structure Set: those of another one contour by contour, those of a label volume
//! slice by slice along its voxels.

use super::super::super::volume::Voxels;
use super::super::Identity;
use super::super::images::Slice;
use super::super::write::{bytes as file_bytes, implicit_bytes};
use super::super::write::{common, decimals, item, now, reference, sequence, string, whole};
use super::{StructureSet, nested, outline};
use crate::error::ContentError;
use dicom_core::DataElement;
use dicom_core::VR;
use dicom_core::value::PrimitiveValue;
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;
use nalgebra::Vector3;
use std::collections::HashSet;
use stylet_anatomy::{Organ, ras_from_lps};

/// Class of a study in references to it; retired for any other use.
const STUDY_CLASS: &str = "1.2.840.10008.3.1.2.3.1";

/// Most corners of a contour: three numbers of 16 characters for each corner then fit into 64 KiB.
const MOST_CORNERS: usize = 65_534 / (3 * 17);

/// Colours, distinct on a dark background.
const COLOURS: [[u8; 3]; 8] = [
    [230, 75, 60],
    [240, 200, 60],
    [150, 95, 60],
    [80, 160, 240],
    [110, 200, 110],
    [200, 110, 220],
    [90, 210, 210],
    [240, 150, 190],
];

/// Structure to write; corners in RAS, m. Structures are numbered from 1 in their order.
pub struct Outlined {
    /// Name of the structure.
    pub name: String,
    /// Closed polygons in planes; the overlap of two in one plane is outside.
    pub contours: Vec<Vec<Vector3<f64>>>,
}

/// Structure set and its references.
pub struct Written<'a> {
    /// SOP instance UID of the file.
    pub uid: &'a str,
    /// Patient, study and frame of reference.
    pub identity: &'a Identity,
    /// Images under the structures, if there are any.
    pub images: &'a [Slice],
    /// The structures.
    pub structures: &'a [Outlined],
}

/// Returns the structures of a label volume, by label.
pub fn of_voxels(v: &Voxels) -> Result<Vec<Outlined>, ContentError> {
    let all: Vec<Outlined> = v
        .present()
        .into_iter()
        .map(|label| Outlined {
            name: v.names.get(&label).cloned().unwrap_or_else(|| format!("label {label}")),
            contours: contours(v, label),
        })
        .collect();
    if all.is_empty() {
        return Err("every voxel is 0, so there is no structure to write".into());
    }
    Ok(all)
}

/// Returns the structures of another structure set, contour by contour.
pub fn of_set(set: StructureSet) -> Vec<Outlined> {
    set.structures
        .into_iter()
        .map(|s| Outlined {
            name: s.name,
            contours: s.contours,
        })
        .collect()
}

/// Returns the bytes of the file.
pub fn bytes(set: &Written) -> Result<Vec<u8>, ContentError> {
    let of = set.identity;
    let numbered = || set.structures.iter().zip(1_usize..);
    let (date, time) = now();
    let mut object = common(uids::RT_STRUCTURE_SET_STORAGE, "RTSTRUCT", of);
    object.put(string(tags::SOP_INSTANCE_UID, set.uid));
    object.put(string(tags::STRUCTURE_SET_LABEL, "Stylet"));
    object.put(string(tags::STRUCTURE_SET_DATE, &date));
    object.put(string(tags::STRUCTURE_SET_TIME, &time));
    object.put(sequence(tags::REFERENCED_FRAME_OF_REFERENCE_SEQUENCE, vec![frame(set)]));
    let roi = |(structure, number): (&Outlined, usize)| {
        item([
            whole(tags::ROI_NUMBER, number),
            string(tags::REFERENCED_FRAME_OF_REFERENCE_UID, &of.frame_of_reference),
            string(tags::ROI_NAME, &structure.name),
            string(tags::ROI_GENERATION_ALGORITHM, ""),
        ])
    };
    object.put(sequence(
        tags::STRUCTURE_SET_ROI_SEQUENCE,
        numbered().map(roi).collect(),
    ));
    let drawn = |(structure, number): (&Outlined, usize)| {
        let colour = COLOURS[(number - 1) % COLOURS.len()].map(|c| c.to_string());
        item([
            DataElement::new(
                tags::ROI_DISPLAY_COLOR,
                VR::IS,
                PrimitiveValue::Strs(colour.to_vec().into()),
            ),
            sequence(tags::CONTOUR_SEQUENCE, drawn(structure, set.images)),
            whole(tags::REFERENCED_ROI_NUMBER, number),
        ])
    };
    object.put(sequence(tags::ROI_CONTOUR_SEQUENCE, numbered().map(drawn).collect()));
    let observed = |(structure, number): (&Outlined, usize)| {
        item([
            whole(tags::OBSERVATION_NUMBER, number),
            whole(tags::REFERENCED_ROI_NUMBER, number),
            string(
                tags::RTROI_INTERPRETED_TYPE,
                Organ::of_name(&structure.name).map_or("", Organ::dicom_type),
            ),
            string(tags::ROI_INTERPRETER, ""),
        ])
    };
    object.put(sequence(
        tags::RTROI_OBSERVATIONS_SEQUENCE,
        numbered().map(observed).collect(),
    ));
    object.put(string(tags::APPROVAL_STATUS, "UNAPPROVED"));
    let contours = set.structures.iter().flat_map(|s| &s.contours);
    match contours.into_iter().any(|c| c.len() > MOST_CORNERS) {
        true => implicit_bytes(object),
        false => file_bytes(object),
    }
}

/// Returns the frame of reference, and the study and the series of the images in it.
fn frame(set: &Written) -> InMemDicomObject {
    let of = set.identity;
    let mut frame = item([string(tags::FRAME_OF_REFERENCE_UID, &of.frame_of_reference)]);
    let Some(first) = set.images.first() else {
        return frame;
    };
    let images = set.images.iter().map(|i| reference(&i.sop_class, &i.uid)).collect();
    let series = item([
        string(tags::SERIES_INSTANCE_UID, &first.series),
        sequence(tags::CONTOUR_IMAGE_SEQUENCE, images),
    ]);
    let mut study = reference(STUDY_CLASS, &first.study);
    study.put(sequence(tags::RT_REFERENCED_SERIES_SEQUENCE, vec![series]));
    frame.put(sequence(tags::RT_REFERENCED_STUDY_SEQUENCE, vec![study]));
    frame
}

fn drawn(structure: &Outlined, images: &[Slice]) -> Vec<InMemDicomObject> {
    // Several loops may be a body with a hole; then all contours of a structure are of that kind.
    let kind = match nested(&structure.contours) {
        true => "CLOSEDPLANAR_XOR",
        false => "CLOSED_PLANAR",
    };
    let contour = |corners: &Vec<Vector3<f64>>| {
        let points = corners.iter().flat_map(|corner| {
            let lps: Vector3<f64> = ras_from_lps(*corner) * 1e3;
            <[f64; 3]>::from(lps)
        });
        let mut contour = item([
            string(tags::CONTOUR_GEOMETRIC_TYPE, kind),
            whole(tags::NUMBER_OF_CONTOUR_POINTS, corners.len()),
            decimals(tags::CONTOUR_DATA, &points.collect::<Vec<_>>()),
        ]);
        if let Some(image) = Slice::under(images, corners) {
            let image = reference(&image.sop_class, &image.uid);
            contour.put(sequence(tags::CONTOUR_IMAGE_SEQUENCE, vec![image]));
        }
        contour
    };
    structure.contours.iter().map(contour).collect()
}

fn contours(v: &Voxels, label: u8) -> Vec<Vec<Vector3<f64>>> {
    let [columns, rows, slices] = v.dims;
    let also: HashSet<u32> = v.also.iter().filter(|(of, _)| *of == label).map(|(_, n)| *n).collect();
    let mut all = Vec::new();
    for k in 0..slices {
        let inside = |i: usize, j: usize| {
            let n = (k * rows + j) * columns + i;
            v.labels[n] == label || (!also.is_empty() && also.contains(&(n as u32)))
        };
        let place = |[i, j]: outline::Corner| v.frame.place_m([i as f64 - 0.5, j as f64 - 0.5, k as f64]);
        let loops = outline::loops([columns, rows], inside).into_iter();
        all.extend(loops.map(|corners| corners.into_iter().map(place).collect::<Vec<_>>()));
    }
    all
}
