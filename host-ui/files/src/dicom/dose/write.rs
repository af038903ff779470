//! A dose as DICOM, for viewers and other planning systems.

use super::super::write::{bytes as file_bytes, common, decimals, item, reference, sequence, string, whole};
use super::kind::ERROR;
use super::{DoseImage, DoseOf, Histogram};
use crate::error::{ContentError, invalid};
use dicom_core::value::PrimitiveValue;
use dicom_core::{DataElement, VR};
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;

/// Returns the bytes of the file; the dose refers to a plan.
pub fn bytes(image: &DoseImage, of: &DoseOf) -> Result<Vec<u8>, ContentError> {
    let [nx, ny, nz] = image.dims;
    if nx * ny * nz != image.dose_gy.len() || image.dims.iter().any(|&d| !(1..=65535).contains(&d)) {
        return Err(invalid!(
            "a dose of {nx} x {ny} x {nz} voxels with {} values cannot be written; each side may have 1 to 65535",
            image.dose_gy.len()
        ));
    }
    if nx * ny * nz > (u32::MAX / 4) as usize {
        return Err("the dose grid has more than 4 GiB; choose larger voxels".into());
    }
    image.kind.writable()?;
    let lowest = image.dose_gy.iter().copied().fold(0.0, f64::min);
    let largest = image.dose_gy.iter().copied().map(f64::abs).fold(0.0, f64::max);
    if !image.dose_gy.iter().all(|d| d.is_finite()) || largest == 0.0 {
        return Err("the dose is 0 everywhere, or not a number somewhere".into());
    }
    // Only differences may be negative (PS3.3, C.8.8.3).
    let is_signed = lowest < 0.0;
    if is_signed && image.kind.dose_type != ERROR {
        return Err(invalid!(
            "it has negative doses, the lowest of {lowest:.3} Gy, which a dose of type {} cannot have",
            image.kind.dose_type
        ));
    }
    let scaling = largest / f64::from(if is_signed { i32::MAX as u32 - 1 } else { u32::MAX - 1 });
    let scaling: f64 = format!("{scaling:.9e}").parse().unwrap_or(scaling);
    let pixels = pixels(image, scaling);
    // Left and posterior are positive in DICOM, so the rows of the file begin at our last voxel.
    let corner_mm = [
        -(image.origin_m[0] + (nx - 1) as f64 * image.spacing_m[0]),
        -(image.origin_m[1] + (ny - 1) as f64 * image.spacing_m[1]),
        image.origin_m[2],
    ]
    .map(|v| v * 1e3);
    let short = |tag, value: usize| DataElement::new(tag, VR::US, PrimitiveValue::from(value as u16));
    let offsets: Vec<f64> = (0..nz).map(|k| k as f64 * image.spacing_m[2] * 1e3).collect();
    let plan = reference(uids::RT_PLAN_STORAGE, of.plan);
    let mut object = common(uids::RT_DOSE_STORAGE, "RTDOSE", of.identity);
    for element in [
        string(tags::SOP_INSTANCE_UID, of.uid),
        string(tags::INSTANCE_NUMBER, "1"),
        decimals(tags::SLICE_THICKNESS, &[image.spacing_m[2] * 1e3]),
        decimals(tags::IMAGE_POSITION_PATIENT, &corner_mm),
        decimals(tags::IMAGE_ORIENTATION_PATIENT, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        short(tags::SAMPLES_PER_PIXEL, 1),
        string(tags::PHOTOMETRIC_INTERPRETATION, "MONOCHROME2"),
        string(tags::NUMBER_OF_FRAMES, &nz.to_string()),
        DataElement::new(
            tags::FRAME_INCREMENT_POINTER,
            VR::AT,
            PrimitiveValue::Tags(vec![tags::GRID_FRAME_OFFSET_VECTOR].into()),
        ),
        short(tags::ROWS, ny),
        short(tags::COLUMNS, nx),
        decimals(
            tags::PIXEL_SPACING,
            &[image.spacing_m[1] * 1e3, image.spacing_m[0] * 1e3],
        ),
        short(tags::BITS_ALLOCATED, 32),
        short(tags::BITS_STORED, 32),
        short(tags::HIGH_BIT, 31),
        short(tags::PIXEL_REPRESENTATION, usize::from(is_signed)),
        string(tags::DOSE_UNITS, "GY"),
        string(tags::DOSE_TYPE, &image.kind.dose_type),
        string(tags::DOSE_SUMMATION_TYPE, &image.kind.summation),
        decimals(tags::GRID_FRAME_OFFSET_VECTOR, &offsets),
        decimals(tags::DOSE_GRID_SCALING, &[scaling]),
        sequence(tags::REFERENCED_RT_PLAN_SEQUENCE, vec![plan]),
        DataElement::new(tags::PIXEL_DATA, VR::OW, PrimitiveValue::U8(pixels.into())),
    ] {
        object.put(element);
    }
    if let Some(set) = of.structure_set.filter(|_| !of.histograms.is_empty()) {
        let set = reference(uids::RT_STRUCTURE_SET_STORAGE, set);
        object.put(sequence(tags::REFERENCED_STRUCTURE_SET_SEQUENCE, vec![set]));
        let histograms = of.histograms.iter().map(histogram).collect();
        object.put(sequence(tags::DVH_SEQUENCE, histograms));
    }
    file_bytes(object)
}

fn histogram(of: &Histogram) -> InMemDicomObject {
    let structure = item([
        string(tags::DVHROI_CONTRIBUTION_TYPE, "INCLUDED"),
        whole(tags::REFERENCED_ROI_NUMBER, of.structure),
    ]);
    // Pairs of the width of a bin in Gy and the volume in cm3.
    let data = of.at_least_m3.iter().flat_map(|m3| [of.bin_gy, m3 * 1e6]);
    let [lowest, mean, highest] = of.range_gy;
    item([
        string(tags::DVH_TYPE, "CUMULATIVE"),
        string(tags::DOSE_UNITS, "GY"),
        string(tags::DOSE_TYPE, "PHYSICAL"),
        decimals(tags::DVH_DOSE_SCALING, &[1.0]),
        string(tags::DVH_VOLUME_UNITS, "CM3"),
        whole(tags::DVH_NUMBER_OF_BINS, of.at_least_m3.len()),
        decimals(tags::DVH_DATA, &data.collect::<Vec<_>>()),
        sequence(tags::DVH_REFERENCED_ROI_SEQUENCE, vec![structure]),
        decimals(tags::DVH_MINIMUM_DOSE, &[lowest]),
        decimals(tags::DVH_MAXIMUM_DOSE, &[highest]),
        decimals(tags::DVH_MEAN_DOSE, &[mean]),
    ])
}

fn pixels(image: &DoseImage, scaling: f64) -> Vec<u8> {
    let [nx, ny, nz] = image.dims;
    let mut pixels = Vec::with_capacity(4 * nx * ny * nz);
    for k in 0..nz {
        for j in (0..ny).rev() {
            for i in (0..nx).rev() {
                let value = (image.dose_gy[(k * ny + j) * nx + i] / scaling).round() as i64 as u32;
                pixels.extend(value.to_le_bytes());
            }
        }
    }
    pixels
}
