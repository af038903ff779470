//! The grid of the image series under a structure set.

mod sparse;

use super::super::element::voxel_count;
use super::super::frame::VoxelFrame;
use super::super::{Progress, bytes};
use super::pixels::{self, Plane};
use super::values::{name, text};
use super::{Identity, Object, Shared, agree, checked};
use crate::error::{ContentError, invalid};
use dicom_dictionary_std::tags;
use nalgebra::{Matrix3, Vector3};
use std::path::{Path, PathBuf};
use stylet_anatomy::ras_from_lps;

pub(super) use sparse::sparse;

/// Most files of a series; a usual one has some hundreds.
const MAX_FILES: usize = 4096;
/// Largest deviation of slices from even distances, as a share of one.
const UNEVEN: f64 = 0.02;
/// Largest deviation of positions that were rounded to 0.1 mm; it is reported.
const ROUNDED_MM: f64 = 0.051;

/// Distance from an image within which a contour lies in it.
const SAME_PLANE_MM: f64 = 0.05;

/// Grid of voxels without values.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Number of voxels along each axis.
    pub dims: [usize; 3],
    /// Place of the voxels in the patient.
    pub frame: VoxelFrame,
}

/// Slice of an image series, without its pixels; LPS, mm.
#[derive(Clone, Debug)]
pub struct Slice {
    /// SOP instance UID.
    pub uid: String,
    /// SOP class UID.
    pub sop_class: String,
    /// Series instance UID.
    pub series: String,
    /// Study instance UID.
    pub study: String,
    /// Patient, study and frame of reference.
    pub identity: Identity,
    corner: Vector3<f64>,
    /// Steps from column to column, and from row to row.
    steps: [Vector3<f64>; 2],
    /// Number of columns, rows.
    size: [usize; 2],
}

/// Returns the slice of an object; `None` for one that is no image with a place.
pub fn slice(object: &Object) -> Option<Result<Slice, ContentError>> {
    let data = &object.data;
    data.get(tags::IMAGE_POSITION_PATIENT)?;
    data.get(tags::ROWS)?;
    let series = text(data, tags::SERIES_INSTANCE_UID)?;
    let plane = || Ok((Plane::of(data, data, data)?, pixels::size(data)?));
    let of_series = |(plane, size)| Slice {
        uid: text(data, tags::SOP_INSTANCE_UID).unwrap_or_default(),
        sop_class: object.sop_class.clone(),
        ..Slice::new((series, Identity::of(object)), &plane, size)
    };
    Some(plane().map(of_series))
}

impl Slice {
    /// Creates a slice of a series; `size` is the number of columns, rows.
    pub(super) fn new((series, identity): (String, Identity), plane: &Plane, size: [usize; 2]) -> Self {
        Self {
            uid: String::new(),
            sop_class: String::new(),
            series,
            study: identity.study.clone(),
            identity,
            corner: plane.corner,
            steps: plane.steps(),
            size,
        }
    }

    /// Returns the normal, not of unit length.
    fn normal(&self) -> Vector3<f64> {
        self.steps[0].cross(&self.steps[1])
    }

    /// Returns the number of its pixels.
    pub(super) fn pixels(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Returns the image that a contour lies in; corners in RAS, m.
    pub fn under<'a>(images: &'a [Self], corners_m: &[Vector3<f64>]) -> Option<&'a Self> {
        let first = images.first()?;
        let normal = first.steps[0].cross(&first.steps[1]).try_normalize(1e-9)?;
        let height = ras_from_lps(*corners_m.first()?).dot(&normal) * 1e3;
        let off = |slice: &Self| (slice.corner.dot(&normal) - height).abs();
        let nearest = images.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
        let beside = |slice: &Self| (slice.corner - nearest.corner).dot(&normal).abs();
        let next = images.iter().map(beside).filter(|d| *d > SAME_PLANE_MM);
        let half = next.fold(f64::INFINITY, f64::min) / 2.0;
        let most = if half.is_finite() { half } else { 0.0 };
        (off(nearest) <= most + SAME_PLANE_MM).then_some(nearest)
    }
}

/// Returns the slices of every series in a folder.
pub fn all_in(folder: &Path) -> Result<Vec<Slice>, ContentError> {
    slices_of(folder, |_| true)
}

/// Returns the slices in a folder that belong to a series or are named one by one, and remarks;
/// they must be of one patient and frame with the structures drawn on them.
pub fn find(
    folder: &Path,
    series: &[String],
    named: &[String],
    of: &Identity,
) -> Result<(Vec<Slice>, Vec<String>), ContentError> {
    let found = slices_of(folder, |slice| {
        series.contains(&slice.series) || named.contains(&slice.uid)
    })?;
    let Some(first) = found.first() else {
        return Ok((found, Vec::new()));
    };
    let notes = together(of, &first.identity, "its images")?;
    Ok((found, notes))
}

/// Compares the identities of a file and of its images; returns remarks.
fn together(of: &Identity, other: &Identity, other_is: &str) -> Result<Vec<String>, ContentError> {
    let both = [(PathBuf::from(other_is), other.clone()), (PathBuf::new(), of.clone())];
    let agreed = agree(&both, Shared::Frame).map_err(|why| why.why)?;
    Ok(agreed.notes.into_iter().map(|(_, note)| note).collect())
}

fn slices_of(folder: &Path, wanted: impl Fn(&Slice) -> bool) -> Result<Vec<Slice>, ContentError> {
    let mut found = Vec::new();
    let paths = if folder.is_dir() {
        dicom_files(folder)?
    } else {
        Vec::new()
    };
    for path in paths {
        let object = bytes::whole(&path, &Progress::default()).and_then(|file| checked::read(&file));
        let Some(read) = object.ok().and_then(|object| slice(&object)) else {
            continue;
        };
        let slice = read.map_err(|why| format!("the image {}: {why}", path.display()))?;
        if wanted(&slice) {
            found.push(slice);
        }
    }
    Ok(found)
}

/// Returns the files of a folder that begin like DICOM.
pub(super) fn dicom_files(folder: &Path) -> Result<Vec<PathBuf>, ContentError> {
    let entries = std::fs::read_dir(folder).map_err(|why| ContentError::Unreadable(why.to_string()))?;
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.retain(|path| begins_as_dicom(path));
    paths.sort();
    if paths.len() > MAX_FILES {
        return Err(invalid!(
            "it has {} DICOM files; at most {MAX_FILES} are read",
            paths.len()
        ));
    }
    Ok(paths)
}

/// Returns whether a file begins like DICOM. Reads only its start, so that large files cost little.
pub(crate) fn begins_as_dicom(path: &Path) -> bool {
    bytes::start(path, 160).is_some_and(|start| checked::is_dicom(&start))
}

/// Sorts items with slices in the order of [`grid`].
pub(super) fn sort<T>(all: &mut [T], slice: impl Fn(&T) -> &Slice) {
    let Some(normal) = all.first().map(|first| slice(first).normal()) else {
        return;
    };
    let height = |of: &T| slice(of).corner.dot(&normal);
    all.sort_by(|a, b| height(a).total_cmp(&height(b)));
}

/// Returns the grid; `None` for fewer than two slices.
pub fn grid(mut slices: Vec<Slice>) -> Result<Option<Grid>, ContentError> {
    let Some(first) = slices.first().cloned() else {
        return Ok(None);
    };
    let normal = first.steps[0]
        .cross(&first.steps[1])
        .try_normalize(1e-9)
        .ok_or("the images have no orientation")?;
    let alike = |s: &Slice| {
        let near = |a: Vector3<f64>, b: Vector3<f64>| (a - b).norm() < 1e-3 * a.norm();
        s.size == first.size && near(first.steps[0], s.steps[0]) && near(first.steps[1], s.steps[1])
    };
    for slice in slices.iter().filter(|slice| slice.identity != first.identity) {
        together(&slice.identity, &first.identity, "another of its images")?;
    }
    if !slices.iter().all(alike) {
        return Err("the images of its series differ in size, spacing or orientation; export one series".into());
    }
    slices.sort_by(|a, b| a.corner.dot(&normal).total_cmp(&b.corner.dot(&normal)));
    let heights: Vec<f64> = slices.iter().map(|s| s.corner.dot(&normal)).collect();
    let count = slices.len();
    if count < 2 {
        return Ok(None);
    }
    let step = (heights[count - 1] - heights[0]) / (count - 1) as f64;
    let off = |(i, h): (usize, &f64)| (h - heights[0] - step * i as f64).abs();
    let most_off = heights.iter().enumerate().map(off).fold(0.0, f64::max);
    let repeated = heights.windows(2).filter(|w| w[1] - w[0] < 1e-3).count();
    if repeated > 0 {
        return Err(invalid!(
            "{repeated} of the {count} images of its series are there twice; keep one series"
        ));
    }
    let is_rounded = most_off <= ROUNDED_MM && most_off < step / 4.0;
    if most_off > UNEVEN * step && !is_rounded {
        // Coordinates rounded to 0.1 mm put an oblique slice off by up to twice that.
        let why = match most_off < 2.0 * ROUNDED_MM && most_off < step / 4.0 {
            true => "their positions seem to be rounded; export them with more decimals",
            false => "some are missing, or their distances differ",
        };
        return Err(invalid!(
            "the {count} images of its series do not lie at even distances (on average {step:.3} mm, off by up to {most_off:.3} mm): {why}"
        ));
    }
    let across = (slices[count - 1].corner - slices[0].corner) / (count - 1) as f64;
    let aside = |(i, s): (usize, &Slice)| {
        let from_row_mm = s.corner - slices[0].corner - across * i as f64;
        (from_row_mm - normal * from_row_mm.dot(&normal)).norm()
    };
    let most_aside = slices.iter().enumerate().map(aside).fold(0.0, f64::max);
    if most_aside > 2.0 * ROUNDED_MM {
        return Err(invalid!(
            "an image of its series lies {most_aside:.3} mm aside of the others ({}); export it again",
            name(tags::IMAGE_POSITION_PATIENT)
        ));
    }
    let columns = Matrix3::from_columns(&[first.steps[0], first.steps[1], across].map(|c| ras_from_lps(c) * 1e-3));
    let mut frame = VoxelFrame::new(columns, ras_from_lps(slices[0].corner) * 1e-3, "image series")?;
    if most_off > UNEVEN * step {
        frame.warning = Some(format!(
            "the positions of its images ({}) are off even distances of {step:.3} mm by up to {most_off:.3} mm; even ones are used",
            name(tags::IMAGE_POSITION_PATIENT)
        ));
    }
    let dims = [first.size[0], first.size[1], count];
    voxel_count(&dims.map(|d| d as u64))?;
    Ok(Some(Grid { dims, frame }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards against a pipe next to a structure set, which was opened and never ended.
    #[test]
    fn a_pipe_near_a_structure_set_is_skipped() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe.dcm");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        assert_eq!(
            find(folder.path(), &["series".to_owned()], &[], &Identity::new())
                .unwrap()
                .0
                .len(),
            0
        );
    }
}
