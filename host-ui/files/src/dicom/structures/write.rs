//! A label volume as RT Structure Set: one structure a label, outlined slice by slice along its voxels.

use super::super::super::volume::Voxels;
use super::super::write::{Identity, common, decimals, item, now, sequence, string, whole};
use super::outline;
use crate::error::ContentError;
use dicom_core::DataElement;
use dicom_core::VR;
use dicom_core::value::PrimitiveValue;
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;
use nalgebra::Vector3;
use stylet_anatomy::{Organ, ras_from_lps};

/// Distinct on a dark background.
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

/// The whole file.
pub fn bytes(v: &Voxels, of: &Identity) -> Result<Vec<u8>, ContentError> {
    let mut present = [false; 256];
    v.labels.iter().for_each(|&l| present[usize::from(l)] = true);
    let labels: Vec<u8> = (1..=255).filter(|&l| present[usize::from(l)]).collect();
    if labels.is_empty() {
        return Err(ContentError::Invalid(
            "every voxel is 0, so there is no structure to write".to_owned(),
        ));
    }
    let name = |label: u8| v.names.get(&label).cloned().unwrap_or_else(|| format!("label {label}"));
    let numbered = || labels.iter().zip(1_usize..);
    let (date, time) = now();
    let mut object = common(uids::RT_STRUCTURE_SET_STORAGE, "RTSTRUCT", of);
    object.put(string(tags::STRUCTURE_SET_LABEL, VR::SH, "Stylet"));
    object.put(string(tags::STRUCTURE_SET_DATE, VR::DA, &date));
    object.put(string(tags::STRUCTURE_SET_TIME, VR::TM, &time));
    let frame = item([string(tags::FRAME_OF_REFERENCE_UID, VR::UI, &of.frame_of_reference)]);
    object.put(sequence(tags::REFERENCED_FRAME_OF_REFERENCE_SEQUENCE, vec![frame]));
    let roi = |(&label, number): (&u8, usize)| {
        item([
            whole(tags::ROI_NUMBER, number),
            string(tags::REFERENCED_FRAME_OF_REFERENCE_UID, VR::UI, &of.frame_of_reference),
            string(tags::ROI_NAME, VR::LO, &name(label)),
            string(tags::ROI_GENERATION_ALGORITHM, VR::CS, ""),
        ])
    };
    object.put(sequence(
        tags::STRUCTURE_SET_ROI_SEQUENCE,
        numbered().map(roi).collect(),
    ));
    let drawn = |(&label, number): (&u8, usize)| {
        let colour = COLOURS[(number - 1) % COLOURS.len()].map(|c| c.to_string());
        item([
            DataElement::new(
                tags::ROI_DISPLAY_COLOR,
                VR::IS,
                PrimitiveValue::Strs(colour.to_vec().into()),
            ),
            sequence(tags::CONTOUR_SEQUENCE, contours(v, label)),
            whole(tags::REFERENCED_ROI_NUMBER, number),
        ])
    };
    object.put(sequence(tags::ROI_CONTOUR_SEQUENCE, numbered().map(drawn).collect()));
    let observed = |(&label, number): (&u8, usize)| {
        item([
            whole(tags::OBSERVATION_NUMBER, number),
            whole(tags::REFERENCED_ROI_NUMBER, number),
            string(
                tags::RTROI_INTERPRETED_TYPE,
                VR::CS,
                Organ::of_name(&name(label)).map_or("", Organ::dicom_type),
            ),
            string(tags::ROI_INTERPRETER, VR::PN, ""),
        ])
    };
    object.put(sequence(
        tags::RTROI_OBSERVATIONS_SEQUENCE,
        numbered().map(observed).collect(),
    ));
    object.put(string(tags::APPROVAL_STATUS, VR::CS, "UNAPPROVED"));
    super::super::write::bytes(object)
}

fn contours(v: &Voxels, label: u8) -> Vec<InMemDicomObject> {
    let [columns, rows, slices] = v.dims;
    let mut all = Vec::new();
    for k in 0..slices {
        let inside = |i: usize, j: usize| v.labels[(k * rows + j) * columns + i] == label;
        let loops = outline::loops([columns, rows], inside);
        // Several loops may be a body with a hole: what lies in two of them is outside.
        let kind = if loops.len() > 1 {
            "CLOSEDPLANAR_XOR"
        } else {
            "CLOSED_PLANAR"
        };
        for corners in loops {
            let number = corners.len();
            let points = corners.into_iter().flat_map(|[i, j]| {
                let place = v.frame.place_m([i as f64 - 0.5, j as f64 - 0.5, k as f64]);
                let lps: Vector3<f64> = ras_from_lps(place) * 1e3;
                <[f64; 3]>::from(lps)
            });
            all.push(item([
                string(tags::CONTOUR_GEOMETRIC_TYPE, VR::CS, kind),
                whole(tags::NUMBER_OF_CONTOUR_POINTS, number),
                decimals(tags::CONTOUR_DATA, &points.collect::<Vec<_>>()),
            ]));
        }
    }
    all
}
