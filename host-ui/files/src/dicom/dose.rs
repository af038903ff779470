//! RT Dose: a dose grid along the patient's axes, for viewers and other planning systems.

use super::plan::SeedPlan;
use super::write::{bytes as file_bytes, common, decimals, item, sequence, string};
use crate::error::ContentError;
use dicom_core::value::PrimitiveValue;
use dicom_core::{DataElement, VR};
use dicom_dictionary_std::{tags, uids};

/// Dose of x fastest; the middle of the first voxel and the steps between them (RAS, m).
pub struct DoseImage<'a> {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Middle of the first voxel (RAS), in m.
    pub origin_m: [f64; 3],
    /// Sides of a voxel, in m.
    pub spacing_m: [f64; 3],
    /// Dose of each voxel, in Gy, x fastest.
    pub dose_gy: &'a [f64],
}

/// The whole file; the dose is that of a plan.
pub fn bytes(image: &DoseImage, of: &SeedPlan) -> Result<Vec<u8>, ContentError> {
    let [nx, ny, nz] = image.dims;
    if nx * ny * nz != image.dose_gy.len() || image.dims.iter().any(|&d| !(1..=65535).contains(&d)) {
        return Err(ContentError::Invalid(format!(
            "a dose of {nx} x {ny} x {nz} voxels with {} values cannot be written; each side may have 1 to 65535",
            image.dose_gy.len()
        )));
    }
    if nx * ny * nz > (u32::MAX / 4) as usize {
        return Err(ContentError::Invalid(
            "the dose grid has more than 4 GiB; choose larger voxels".to_owned(),
        ));
    }
    let highest = image.dose_gy.iter().copied().fold(0.0, f64::max);
    if !image.dose_gy.iter().all(|d| d.is_finite() && *d >= 0.0) || highest == 0.0 {
        return Err(ContentError::Invalid(
            "the dose is nowhere above 0, or it is no number somewhere".to_owned(),
        ));
    }
    let scaling = highest / f64::from(u32::MAX - 1);
    let scaling: f64 = format!("{scaling:.9e}").parse().unwrap_or(scaling);
    let pixels = pixels(image, scaling);
    // Left and posterior are up: the rows of the file begin at the last voxel of ours.
    let corner_mm = [
        -(image.origin_m[0] + (nx - 1) as f64 * image.spacing_m[0]),
        -(image.origin_m[1] + (ny - 1) as f64 * image.spacing_m[1]),
        image.origin_m[2],
    ]
    .map(|v| v * 1e3);
    let short = |tag, value: usize| DataElement::new(tag, VR::US, PrimitiveValue::from(value as u16));
    let offsets: Vec<f64> = (0..nz).map(|k| k as f64 * image.spacing_m[2] * 1e3).collect();
    let plan = item([
        string(tags::REFERENCED_SOP_CLASS_UID, VR::UI, uids::RT_PLAN_STORAGE),
        string(tags::REFERENCED_SOP_INSTANCE_UID, VR::UI, &of.uid),
    ]);
    let mut object = common(uids::RT_DOSE_STORAGE, "RTDOSE", &of.identity);
    for element in [
        string(tags::INSTANCE_NUMBER, VR::IS, "1"),
        decimals(tags::SLICE_THICKNESS, &[image.spacing_m[2] * 1e3]),
        decimals(tags::IMAGE_POSITION_PATIENT, &corner_mm),
        decimals(tags::IMAGE_ORIENTATION_PATIENT, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        short(tags::SAMPLES_PER_PIXEL, 1),
        string(tags::PHOTOMETRIC_INTERPRETATION, VR::CS, "MONOCHROME2"),
        string(tags::NUMBER_OF_FRAMES, VR::IS, &nz.to_string()),
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
        short(tags::PIXEL_REPRESENTATION, 0),
        string(tags::DOSE_UNITS, VR::CS, "GY"),
        string(tags::DOSE_TYPE, VR::CS, "PHYSICAL"),
        string(tags::DOSE_SUMMATION_TYPE, VR::CS, "PLAN"),
        decimals(tags::GRID_FRAME_OFFSET_VECTOR, &offsets),
        decimals(tags::DOSE_GRID_SCALING, &[scaling]),
        sequence(tags::REFERENCED_RT_PLAN_SEQUENCE, vec![plan]),
        DataElement::new(tags::PIXEL_DATA, VR::OW, PrimitiveValue::U8(pixels.into())),
    ] {
        object.put(element);
    }
    file_bytes(object)
}

fn pixels(image: &DoseImage, scaling: f64) -> Vec<u8> {
    let [nx, ny, nz] = image.dims;
    let mut pixels = Vec::with_capacity(4 * nx * ny * nz);
    for k in 0..nz {
        for j in (0..ny).rev() {
            for i in (0..nx).rev() {
                let value = (image.dose_gy[(k * ny + j) * nx + i] / scaling).round() as u32;
                pixels.extend(value.to_le_bytes());
            }
        }
    }
    pixels
}
