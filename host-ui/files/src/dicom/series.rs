//! Image series of CT, MR and ultrasound as one volume: a file for each slice, or all slices in one (enhanced multi-frame).

use super::super::Progress;
use super::super::bytes;
use super::super::element::{Endian, MAX_IMAGE_VOXELS, short};
use super::super::overlap::joined;
use super::super::progress::Stage;
use super::super::volume::VoxelValues;
use super::images::{self, Slice};
use super::pixels::{self, Groups, Pixel};
use super::segmentation::is_segmentation;
use super::values::{items, name, number, text};
use super::{Identity, Object, checked};
use crate::error::{ContentError, FileError, invalid};
use dicom_core::Tag;
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Reads the only series of a folder, or the series of the file `path`: its values, such as
/// Hounsfield units.
///
/// # Errors
///
/// No series, several of them in a folder, compressed pixels, colours, missing or duplicate slices.
pub fn read(path: &Path, progress: &Progress) -> Result<VoxelValues<f32>, FileError> {
    of_path(path, progress).map_err(|why| FileError::of(path, why))
}

fn of_path(path: &Path, progress: &Progress) -> Result<VoxelValues<f32>, ContentError> {
    let frames = match path.is_dir() {
        true => of_folder(path, None, progress)?,
        false => {
            let file = bytes::whole(path, progress)?;
            let (object, pixels, endian) = checked::read_with_pixels(&file)?;
            match is_enhanced(&object) {
                true => enhanced(&object, &pixels, endian, progress)?,
                false => rest_of_series(path, &object, progress)?,
            }
        }
    };
    volume(frames)
}

/// Returns the volume of the slices of one series, in any order.
pub(super) fn volume(mut frames: Vec<Frame>) -> Result<VoxelValues<f32>, ContentError> {
    let slices: Vec<Slice> = frames.iter().map(|frame| frame.slice.clone()).collect();
    let mut grid = images::grid(slices)?.ok_or("it is one slice alone; a volume has at least two")?;
    let loss = frames.iter_mut().find_map(|frame| frame.loss.take());
    grid.frame.warning = joined(grid.frame.warning.take(), loss);
    let [columns, rows, _] = grid.dims;
    // In the order of the grid.
    images::sort(&mut frames, |frame| &frame.slice);
    let mut values = Vec::with_capacity(columns * rows * frames.len());
    for frame in frames {
        values.extend(frame.values);
    }
    Ok(VoxelValues {
        dims: grid.dims,
        values,
        frame: grid.frame,
    })
}

/// Returns modality and unit of the values of a series, by one of its files, or the first image of
/// a folder; `None` if it is not DICOM.
pub fn modality(path: &Path) -> Result<Option<(String, String)>, FileError> {
    let files = match path.is_dir() {
        true => images::dicom_files(path).map_err(|why| FileError::of(path, why))?,
        false => vec![path.to_owned()],
    };
    let of_image = |file: &PathBuf| {
        let content = bytes::whole(file, &Progress::default()).ok()?;
        let object = checked::read_head(&content).ok()?;
        let data = &object.data;
        data.get(tags::ROWS).filter(|_| !is_of_images(&object))?;
        let of = |tag: Tag| text(data, tag).unwrap_or_default();
        Some((of(tags::MODALITY), of(tags::RESCALE_TYPE)))
    };
    Ok(files
        .iter()
        .filter(|file| images::begins_as_dicom(file))
        .find_map(of_image))
}

/// One slice with its values, row by row.
pub(super) struct Frame {
    slice: Slice,
    values: Vec<f32>,
    /// Remark on compression with loss.
    loss: Option<String>,
}

/// Returns the slices of the only series of a folder, or of the series `wanted`.
fn of_folder(folder: &Path, wanted: Option<&str>, progress: &Progress) -> Result<Vec<Frame>, ContentError> {
    let paths = images::dicom_files(folder)?;
    let mut series: BTreeMap<String, (Vec<PathBuf>, String)> = BTreeMap::new();
    let mut unread: Vec<String> = Vec::new();
    for (n, path) in paths.iter().enumerate() {
        progress.report(Stage::Bytes, n, 2 * paths.len())?;
        let Ok(file) = bytes::whole(path, &Progress::default()) else {
            continue;
        };
        let object = match checked::read(&file) {
            Ok(object) => object,
            Err(why) => {
                unread.push(format!("{}: {why}", bytes::file_name(path)));
                continue;
            }
        };
        let data = &object.data;
        let (Some(uid), Some(_)) = (text(data, tags::SERIES_INSTANCE_UID), data.get(tags::ROWS)) else {
            continue;
        };
        let is_image = data.get(tags::IMAGE_POSITION_PATIENT).is_some() || is_enhanced(&object);
        if is_image && !is_of_images(&object) {
            let about = || {
                let of = |tag: Tag| text(data, tag).unwrap_or_default();
                format!("{} \"{}\"", of(tags::MODALITY), short(&of(tags::SERIES_DESCRIPTION)))
            };
            let entry = series.entry(uid).or_insert_with(|| (Vec::new(), about()));
            entry.0.push(path.clone());
        }
    }
    if let Some(why) = unread.first() {
        // One of them may be a slice of the series.
        return Err(invalid!(
            "{} of its {} DICOM files cannot be read, so an image may be missing: {why}",
            unread.len(),
            paths.len()
        ));
    }
    series.retain(|uid, _| wanted.is_none_or(|wanted| wanted == uid));
    let mut series: Vec<(Vec<PathBuf>, String)> = series.into_values().collect();
    let Some((paths, about)) = series.pop() else {
        return Err("it contains no DICOM image series; choose another folder".into());
    };
    if !series.is_empty() {
        let mut all: Vec<String> = series.iter().map(|(p, about)| one_of_several(p, about)).collect();
        all.push(one_of_several(&paths, &about));
        return Err(invalid!(
            "it contains {} series; give a file of the one you mean:\n  {}",
            all.len(),
            all.join("\n  ")
        ));
    }
    frames_of(&paths, progress)
}

fn one_of_several(paths: &[PathBuf], about: &str) -> String {
    let first = paths.first().map(|path| path.display().to_string()).unwrap_or_default();
    format!("{first}: {about}, {} files", paths.len())
}

/// Returns the files of the same series in the folder of a file.
fn rest_of_series(path: &Path, object: &Object, progress: &Progress) -> Result<Vec<Frame>, ContentError> {
    if object.data.get(tags::IMAGE_POSITION_PATIENT).is_none() {
        return Err(unplaced(object));
    }
    let series = text(&object.data, tags::SERIES_INSTANCE_UID).unwrap_or_default();
    of_folder(bytes::folder(path), Some(&series), progress)
}

/// Explains why an image without a place in the patient is refused.
fn unplaced(object: &Object) -> ContentError {
    let modality = text(&object.data, tags::MODALITY).unwrap_or_default();
    invalid!(
        "its {} image does not give its position in the patient ({}); export a volume with a position, or as NRRD",
        short(&modality),
        name(tags::IMAGE_POSITION_PATIENT)
    )
}

fn frames_of(paths: &[PathBuf], progress: &Progress) -> Result<Vec<Frame>, ContentError> {
    let mut frames = Vec::new();
    for (n, path) in paths.iter().enumerate() {
        progress.report(Stage::Voxels, n, paths.len())?;
        let within = |why: ContentError| why.within(path.display());
        let file = bytes::whole(path, &Progress::default())?;
        let (object, pixels, endian) = checked::read_with_pixels(&file).map_err(within)?;
        if is_enhanced(&object) {
            frames.extend(enhanced(&object, &pixels, endian, progress).map_err(within)?);
            continue;
        }
        let frame = frame_of(&object, &pixels, endian).map_err(within)?;
        check_size(frame.values.len(), paths.len())?;
        frames.push(frame);
    }
    Ok(frames)
}

/// Reads the slice in an object.
pub(super) fn frame_of(object: &Object, pixels: &[u8], endian: Endian) -> Result<Frame, ContentError> {
    let slice = images::slice(object).ok_or_else(|| unplaced(object))??;
    let scale = scale_of(Some(&object.data), &modality_of(object)?)?;
    let values = Pixel::of(&object.data)?.values(pixels, endian, slice.pixels())?;
    Ok(Frame {
        slice,
        values: scaled(values, scale),
        loss: object.loss.clone(),
    })
}

fn modality_of(object: &Object) -> Result<String, ContentError> {
    let missing = || {
        invalid!(
            "{} is missing, so the meaning of its values is not known",
            name(tags::MODALITY)
        )
    };
    text(&object.data, tags::MODALITY).ok_or_else(missing)
}

/// Returns whether the pixels of an object are a dose or structures of a series, not its images.
fn is_of_images(object: &Object) -> bool {
    object.sop_class == super::RT_DOSE || is_segmentation(&object.sop_class)
}

fn is_enhanced(object: &Object) -> bool {
    object.data.get(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).is_some()
}

/// Returns slope and intercept from the stored number to the value; only values of a CT must have them.
fn scale_of(data: Option<&InMemDicomObject>, modality: &str) -> Result<[f64; 2], ContentError> {
    let given = |tag: Tag| data.map_or(Ok(None), |data| number(data, tag));
    match (given(tags::RESCALE_SLOPE)?, given(tags::RESCALE_INTERCEPT)?) {
        (Some(0.0), _) => Err(invalid!("{} is 0", name(tags::RESCALE_SLOPE))),
        (Some(slope), Some(intercept)) => Ok([slope, intercept]),
        (None, None) if modality != "CT" => Ok([1.0, 0.0]),
        (slope, _) => {
            let missing = if slope.is_none() {
                tags::RESCALE_SLOPE
            } else {
                tags::RESCALE_INTERCEPT
            };
            Err(invalid!("{} is missing, so its values are not in HU", name(missing)))
        }
    }
}

fn scaled(values: Vec<f64>, [slope, intercept]: [f64; 2]) -> Vec<f32> {
    let scaled = |value: f64| (value * slope + intercept) as f32;
    values.into_iter().map(scaled).collect()
}

fn check_size(of_slice: usize, slices: usize) -> Result<(), ContentError> {
    match of_slice.saturating_mul(slices) {
        0..=MAX_IMAGE_VOXELS => Ok(()),
        count => Err(invalid!(
            "it has {count} voxels, more than {MAX_IMAGE_VOXELS}; export a part of it"
        )),
    }
}

/// Reads the frames of an enhanced image: common attributes stand once, the others with each frame.
fn enhanced(object: &Object, pixels: &[u8], endian: Endian, progress: &Progress) -> Result<Vec<Frame>, ContentError> {
    let data = &object.data;
    let groups = Groups::of(data)?;
    let count = groups.len();
    let size = pixels::size(data)?;
    let pixel = Pixel::of(data)?;
    let of_frame = size[0] * size[1];
    check_size(of_frame, count)?;
    let bytes = of_frame * pixel.bytes();
    let series = text(data, tags::SERIES_INSTANCE_UID).unwrap_or_default();
    let modality = modality_of(object)?;
    let mut frames = Vec::new();
    for (n, groups) in groups.iter().enumerate() {
        progress.report(Stage::Voxels, n, count)?;
        let place = groups.get(tags::PLANE_POSITION_SEQUENCE);
        let is_relative = !items(groups.own, tags::PLANE_POSITION_VOLUME_SEQUENCE).is_empty();
        if is_relative && place.and_then(|p| p.get(tags::IMAGE_POSITION_PATIENT)).is_none() {
            return Err("its frames are positioned relative to the probe, not the patient; export it as NRRD".into());
        }
        let plane = groups.plane();
        let plane = plane.map_err(|why| why.within(format_args!("frame {}", n + 1)))?;
        let scale = scale_of(groups.get(tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE), &modality)?;
        let raw = pixels.get(n * bytes..(n + 1) * bytes).ok_or_else(|| {
            invalid!(
                "it is truncated: frame {} of {count} is missing; copy or export it again",
                n + 1
            )
        })?;
        let values = scaled(pixel.values(raw, endian, of_frame)?, scale);
        let slice = Slice::new((series.clone(), Identity::of(object)), &plane, size);
        let loss = object.loss.clone();
        frames.push(Frame { slice, values, loss });
    }
    Ok(frames)
}

#[cfg(test)]
pub(super) mod tests;
