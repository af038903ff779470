//! A dose from DICOM: any even grid along the patient's axes, whatever the directions of its rows
//! and frames.

use super::super::super::element::{Endian, short, voxel_count};
use super::super::pixels::{self, Pixel, Plane};
use super::super::values::{items, name, needed, number, numbers, text};
use super::super::{Object, checked};
use super::DoseKind;
use crate::VoxelValues;
use crate::error::{ContentError, FileError, invalid};
use crate::progress::Progress;
use dicom_core::Tag;
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;
use nalgebra::Vector3;
use std::path::Path;
use stylet_anatomy::ras_from_lps;

/// Largest deviation of an axis from the patient's, as the sine of the angle; beyond it the axis is
/// oblique.
const OBLIQUE: f64 = 1e-3;
/// Largest deviation of frames from even distances, as a share of one.
const UNEVEN: f64 = 1e-3;

/// Dose from a file, its voxels in the order of [`super::DoseImage`].
#[derive(Clone, Debug, PartialEq)]
pub struct ReadDose {
    /// Type and summation.
    pub kind: DoseKind,
    /// Remarks on the reading for the user.
    pub notes: Vec<String>,
    /// SOP instance UID of the dose itself.
    pub uid: String,
    /// SOP instance UID of its RT Plan.
    pub plan: Option<String>,
    /// SOP instance UID of the structure set of its histograms.
    pub structure_set: Option<String>,
    /// Number of voxels along x, y, z.
    pub dims: [usize; 3],
    /// Centre of the first voxel (RAS), in m.
    pub origin_m: [f64; 3],
    /// Sides of a voxel, in m.
    pub spacing_m: [f64; 3],
    /// Dose of each voxel, in Gy, x fastest.
    pub dose_gy: Vec<f64>,
}

/// Reads the dose in the file at `path`.
pub fn of_file(path: &Path) -> Result<ReadDose, FileError> {
    let refused = |why| FileError::of(path, why);
    let bytes = crate::bytes::whole(path, &Progress::default()).map_err(refused)?;
    let (object, pixels, endian) = checked::read_with_pixels(&bytes).map_err(refused)?;
    of(&object, &pixels, endian).map_err(refused)
}

pub(in crate::dicom) fn of(object: &Object, pixels: &[u8], endian: Endian) -> Result<ReadDose, ContentError> {
    if object.sop_class != uids::RT_DOSE_STORAGE {
        return Err(invalid!(
            "it is DICOM of another kind (SOP class {}); a dose is an RT Dose",
            short(&object.sop_class)
        ));
    }
    let data = &object.data;
    let units = text(data, tags::DOSE_UNITS).unwrap_or_default();
    if units != "GY" {
        let units = short(&units);
        return Err(invalid!("its dose is in \"{units}\"; only doses in GY are read"));
    }
    let grid = Layout::of(data)?;
    let raw = Pixel::of(data)?
        .whole()?
        .values(pixels, endian, grid.counts.iter().product())?;
    let scaling = needed(data, tags::DOSE_GRID_SCALING, f64::MIN_POSITIVE, 1e12)?;
    let first = |tag| {
        let item = items(data, tag).first()?;
        text(item, tags::REFERENCED_SOP_INSTANCE_UID)
    };
    let (kind, mut notes) = DoseKind::of(data)?;
    notes.extend(object.loss.clone());
    let values: Vec<f64> = raw.iter().map(|value| value * scaling).collect();
    Ok(ReadDose {
        uid: text(data, tags::SOP_INSTANCE_UID).unwrap_or_default(),
        plan: first(tags::REFERENCED_RT_PLAN_SEQUENCE),
        structure_set: first(tags::REFERENCED_STRUCTURE_SET_SEQUENCE),
        ..grid.dose(&values, kind, notes)
    })
}

impl ReadDose {
    /// Returns a remark for each reference to another plan or structure set than these files.
    pub fn other_references(&self, plan: Option<&Path>, structure_set: Option<&Path>) -> Vec<String> {
        let named = [
            (tags::REFERENCED_RT_PLAN_SEQUENCE, &self.plan, plan),
            (
                tags::REFERENCED_STRUCTURE_SET_SEQUENCE,
                &self.structure_set,
                structure_set,
            ),
        ];
        let other = |(tag, uid, file): (Tag, &Option<String>, Option<&Path>)| {
            let (uid, file) = (uid.as_ref()?, file?);
            let found = instance_of(file)?;
            (found != *uid).then(|| format!("{} names another file than {}", name(tag), file.display()))
        };
        named.into_iter().filter_map(other).collect()
    }
}

/// Returns the SOP instance UID of a DICOM file; `None` for any other one.
fn instance_of(path: &Path) -> Option<String> {
    let content = crate::bytes::whole(path, &Progress::default()).ok()?;
    let object = checked::is_dicom(&content).then(|| checked::read_head(&content).ok())??;
    text(&object.data, tags::SOP_INSTANCE_UID)
}

/// Takes a volume of another format as a dose in gray.
pub fn of_volume(volume: &VoxelValues<f64>, kind: DoseKind) -> Result<ReadDose, ContentError> {
    let frame = &volume.frame;
    let steps = [0, 1, 2].map(|a| frame.directions.column(a) * frame.spacing_m[a]);
    let grid = Layout::along(volume.dims, frame.origin_m, steps)?;
    if !volume.values.iter().all(|gy| gy.is_finite()) {
        return Err("it contains a value that is not a number; write it again".into());
    }
    let notes = frame.warning.iter().cloned().chain(kind.remarks()).collect();
    Ok(grid.dose(&volume.values, kind, notes))
}

/// Layout of a file's voxels in the patient: columns, rows and frames, in this order, each with an
/// axis of the patient.
struct Layout {
    /// Number of columns, rows, frames.
    counts: [usize; 3],
    /// Axis of the patient along which each of them runs.
    axes: [usize; 3],
    /// Step along that axis (RAS, m), negative in the opposite direction.
    steps_m: [f64; 3],
    /// Centre of the first voxel of the file (RAS, m).
    first_m: Vector3<f64>,
}

impl Layout {
    fn of(data: &InMemDicomObject) -> Result<Self, ContentError> {
        let frames = match text(data, tags::NUMBER_OF_FRAMES) {
            Some(_) => needed(data, tags::NUMBER_OF_FRAMES, 1.0, 65535.0)? as usize,
            None => 1,
        };
        let [columns, rows] = pixels::size(data)?;
        let counts = [columns, rows, frames];
        voxel_count(&counts.map(|c| c as u64))?;
        let plane = Plane::of(data, data, data)?;
        let across = plane.directions[0].cross(&plane.directions[1]);
        let [along_rows, along_columns] = plane.steps();
        let steps = [
            along_rows,
            along_columns,
            across * frame_step_mm(data, frames, plane.corner, across)?,
        ];
        let in_ras = |mm: Vector3<f64>| ras_from_lps(mm) * 1e-3;
        Self::along(counts, in_ras(plane.corner), steps.map(in_ras))
    }

    /// Creates a layout from the counts, the centre of the first voxel and the steps along columns,
    /// rows and frames (RAS, m), which must be along the patient's axes.
    fn along(counts: [usize; 3], first_m: Vector3<f64>, steps: [Vector3<f64>; 3]) -> Result<Self, ContentError> {
        let mut axes = [0; 3];
        let mut steps_m = [0.0; 3];
        for (n, ras) in steps.iter().enumerate() {
            let axis = ras.iamax();
            let aside = ras.norm_squared() - ras[axis] * ras[axis];
            // NaN compares false.
            if !(aside.max(0.0).sqrt() <= OBLIQUE * ras.norm() && ras.norm() > 1e-6) {
                return Err("its grid is oblique to the patient; export it along the patient's axes".into());
            }
            (axes[n], steps_m[n]) = (axis, ras[axis]);
        }
        let mut sorted = axes;
        sorted.sort_unstable();
        if sorted != [0, 1, 2] {
            return Err("its axes are not at right angles (ImageOrientationPatient)".into());
        }
        Ok(Self {
            counts,
            axes,
            steps_m,
            first_m,
        })
    }

    /// Returns the dose of values in the order of the file.
    fn dose(&self, values: &[f64], kind: DoseKind, mut notes: Vec<String>) -> ReadDose {
        let dose_gy: Vec<f64> = self.in_order(values).collect();
        let lowest = dose_gy.iter().copied().fold(0.0, f64::min);
        if lowest < 0.0 {
            notes.push(format!("it has negative doses, the lowest of {lowest:.3} Gy"));
        }
        ReadDose {
            kind,
            notes,
            uid: String::new(),
            plan: None,
            structure_set: None,
            dims: self.dims(),
            origin_m: self.origin_m(),
            spacing_m: self.spacing_m(),
            dose_gy,
        }
    }

    /// Reorders columns, rows and frames to the patient's x, y, z.
    fn turned<T: Copy + Default>(&self, of_file: [T; 3]) -> [T; 3] {
        let mut turned = [T::default(); 3];
        for (n, axis) in self.axes.into_iter().enumerate() {
            turned[axis] = of_file[n];
        }
        turned
    }

    fn dims(&self) -> [usize; 3] {
        self.turned(self.counts)
    }

    fn spacing_m(&self) -> [f64; 3] {
        self.turned(self.steps_m.map(f64::abs))
    }

    fn origin_m(&self) -> [f64; 3] {
        let mut origin = self.first_m;
        for n in 0..3 {
            origin[self.axes[n]] += (self.steps_m[n] * (self.counts[n] - 1) as f64).min(0.0);
        }
        origin.into()
    }

    /// Returns the values of the file with x fastest, for any order of the file.
    fn in_order<'a>(&'a self, raw: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let strides = [1, self.counts[0], self.counts[0] * self.counts[1]];
        let (strides, is_turned) = (self.turned(strides), self.turned(self.steps_m.map(|s| s < 0.0)));
        let [nx, ny, nz] = self.dims();
        let at =
            move |axis: usize, count: usize, i: usize| strides[axis] * if is_turned[axis] { count - 1 - i } else { i };
        (0..nx * ny * nz).map(move |n| raw[at(0, nx, n % nx) + at(1, ny, n / nx % ny) + at(2, nz, n / nx / ny)])
    }
}

/// Returns the distance of frames along the normal of the rows, in mm; 1 for one frame without a
/// thickness.
fn frame_step_mm(
    data: &InMemDicomObject,
    frames: usize,
    first_mm: Vector3<f64>,
    across: Vector3<f64>,
) -> Result<f64, ContentError> {
    if frames == 1 {
        let thickness = number(data, tags::SLICE_THICKNESS)?;
        return Ok(thickness.filter(|mm| *mm > 0.0).unwrap_or(1.0));
    }
    let offsets = numbers(data, tags::GRID_FRAME_OFFSET_VECTOR)?.unwrap_or_default();
    let refused = |why: String| invalid!("{} {why}", name(tags::GRID_FRAME_OFFSET_VECTOR));
    if offsets.len() != frames {
        return Err(refused(format!("has {} values for {frames} frames", offsets.len())));
    }
    // Either distances from the first frame, or coordinates along the patient.
    let absolute = offsets[0] != 0.0;
    if absolute && (offsets[0] - first_mm.z).abs() > 1e-3 {
        return Err(refused(format!(
            "begins with {}; it must begin with 0 or the height of the first frame",
            offsets[0]
        )));
    }
    // PS3.3 C.8.8.3.2 gives heights a meaning only in planes across z whose normal points to the head.
    if absolute && across.z < 1.0 - OBLIQUE {
        return Err(refused(
            "gives heights, which have no meaning in this ImageOrientationPatient; export distances from the first frame"
                .to_owned(),
        ));
    }
    let step = (offsets[frames - 1] - offsets[0]) / (frames - 1) as f64;
    let is_even = |(n, offset): (usize, &f64)| (offset - offsets[0] - step * n as f64).abs() <= UNEVEN * step.abs();
    if step == 0.0 || !offsets.iter().enumerate().all(is_even) {
        return Err(refused("does not go in even steps; export an even grid".to_owned()));
    }
    Ok(step)
}
