//! Image series of CT, MR and ultrasound as one volume: a file for each slice, or all slices in one (enhanced multi-frame).

use super::super::Progress;
use super::super::bytes;
use super::super::element::{Element, Endian, MAX_IMAGE_VOXELS, Sink, read_values, short};
use super::super::progress::Stage;
use super::super::volume::VoxelValues;
use super::images::{self, Slice};
use super::values::{items, name, needed, number, numbers, text};
use super::{Identity, Object, checked};
use crate::error::{ContentError, FileError};
use dicom_core::Tag;
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Most files of a series; a usual one has some hundreds.
const MAX_FILES: usize = 4096;
/// Most frames of one file.
const MAX_FRAMES: f64 = 65_535.0;

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
    let mut frames = match path.is_dir() {
        true => of_folder(path, progress)?,
        false => {
            let file = bytes::whole(path, progress)?;
            let (object, pixels, endian) = opened(&file)?;
            match is_enhanced(&object) {
                true => enhanced(&object, pixels, endian, progress)?,
                false => rest_of_series(path, &object, progress)?,
            }
        }
    };
    let slices: Vec<Slice> = frames.iter().map(|frame| frame.slice.clone()).collect();
    let grid = images::grid(slices)?.ok_or("it is one slice alone; a volume has at least two")?;
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
        true => dicom_files(path).map_err(|why| FileError::of(path, why))?,
        false if images::begins_as_dicom(path) => vec![path.to_owned()],
        false => Vec::new(),
    };
    for file in files {
        let Ok(content) = bytes::whole(&file, &Progress::default()) else {
            continue;
        };
        let Ok(object) = checked::read_head(&content) else {
            continue;
        };
        let of = |tag: Tag| text(&object.data, tag).unwrap_or_default();
        if object.data.get(tags::ROWS).is_some() {
            return Ok(Some((of(tags::MODALITY), of(tags::RESCALE_TYPE))));
        }
    }
    Ok(None)
}

/// One slice with its values, row by row.
struct Frame {
    slice: Slice,
    values: Vec<f32>,
}

/// Returns the files of a folder that begin like DICOM.
fn dicom_files(folder: &Path) -> Result<Vec<PathBuf>, ContentError> {
    let entries = std::fs::read_dir(folder).map_err(|why| ContentError::Unreadable(why.to_string()))?;
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.retain(|path| images::begins_as_dicom(path));
    paths.sort();
    if paths.len() > MAX_FILES {
        return Err(ContentError::Invalid(format!(
            "it has {} DICOM files; at most {MAX_FILES} are read",
            paths.len()
        )));
    }
    Ok(paths)
}

fn of_folder(folder: &Path, progress: &Progress) -> Result<Vec<Frame>, ContentError> {
    let paths = dicom_files(folder)?;
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
        if is_image && object.sop_class != super::RT_DOSE {
            let about = || {
                let of = |tag: Tag| text(data, tag).unwrap_or_default();
                format!("{} \"{}\"", of(tags::MODALITY), short(&of(tags::SERIES_DESCRIPTION)))
            };
            let entry = series.entry(uid).or_insert_with(|| (Vec::new(), about()));
            entry.0.push(path.clone());
        }
    }
    let mut series: Vec<(Vec<PathBuf>, String)> = series.into_values().collect();
    if let Some(why) = unread.first() {
        // One of them may be a slice of the series.
        return Err(ContentError::Invalid(format!(
            "{} of its {} DICOM files cannot be read, so an image may be missing: {why}",
            unread.len(),
            paths.len()
        )));
    }
    let Some((paths, _)) = series.pop() else {
        return Err("it contains no DICOM image series; choose another folder".into());
    };
    if !series.is_empty() {
        let mut all: Vec<String> = series.iter().map(|(p, about)| one_of_several(p, about)).collect();
        all.push(one_of_several(&paths, "the last"));
        return Err(ContentError::Invalid(format!(
            "it contains {} series; give a file of the one you mean:\n  {}",
            all.len(),
            all.join("\n  ")
        )));
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
    let series = text(&object.data, tags::SERIES_INSTANCE_UID);
    let mut paths = Vec::new();
    for other in dicom_files(bytes::folder(path))? {
        let Ok(file) = bytes::whole(&other, &Progress::default()) else {
            continue;
        };
        let of_series = checked::read(&file).map(|o| text(&o.data, tags::SERIES_INSTANCE_UID));
        let of_series = of_series.map_err(|why| {
            why.within(format_args!(
                "{} in its folder cannot be read, so an image may be missing",
                other.display()
            ))
        })?;
        if of_series == series {
            paths.push(other);
        }
    }
    frames_of(&paths, progress)
}

/// Explains why an image without a place in the patient is refused.
fn unplaced(object: &Object) -> ContentError {
    let modality = text(&object.data, tags::MODALITY).unwrap_or_default();
    ContentError::Invalid(format!(
        "its {} image does not give its position in the patient ({}); export a volume with a position, or as NRRD",
        short(&modality),
        name(tags::IMAGE_POSITION_PATIENT)
    ))
}

fn frames_of(paths: &[PathBuf], progress: &Progress) -> Result<Vec<Frame>, ContentError> {
    let mut frames = Vec::new();
    for (n, path) in paths.iter().enumerate() {
        progress.report(Stage::Voxels, n, paths.len())?;
        let within = |why: ContentError| why.within(path.display());
        let file = bytes::whole(path, &Progress::default())?;
        let (object, pixels, endian) = opened(&file).map_err(within)?;
        if is_enhanced(&object) {
            frames.extend(enhanced(&object, pixels, endian, progress).map_err(within)?);
            continue;
        }
        let (_, slice) = images::slice(&file).ok_or_else(|| unplaced(&object))?.map_err(within)?;
        let pixel = Pixel::of(&object.data).map_err(within)?;
        let scale = scale_of(&object.data).map_err(within)?;
        check_size(slice.pixels(), paths.len())?;
        let values = pixel.values(pixels, endian, slice.pixels(), scale).map_err(within)?;
        frames.push(Frame { slice, values });
    }
    Ok(frames)
}

fn opened(file: &[u8]) -> Result<(Object, &[u8], Endian), ContentError> {
    let (object, pixels, is_big_endian) = checked::read_with_pixels(file)?;
    Ok((object, pixels, if is_big_endian { Endian::Big } else { Endian::Little }))
}

fn is_enhanced(object: &Object) -> bool {
    object.data.get(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).is_some()
}

/// Returns slope and intercept from the stored number to the value.
fn scale_of(data: &InMemDicomObject) -> Result<[f64; 2], ContentError> {
    if text(data, tags::MODALITY).as_deref() == Some("CT") {
        for tag in [tags::RESCALE_SLOPE, tags::RESCALE_INTERCEPT] {
            number(data, tag)?.ok_or_else(|| format!("{} is missing, so its values are not in HU", name(tag)))?;
        }
    }
    let slope = number(data, tags::RESCALE_SLOPE)?.unwrap_or(1.0);
    let intercept = number(data, tags::RESCALE_INTERCEPT)?.unwrap_or(0.0);
    if slope == 0.0 {
        return Err(ContentError::Invalid(format!("{} is 0", name(tags::RESCALE_SLOPE))));
    }
    Ok([slope, intercept])
}

fn check_size(of_slice: usize, slices: usize) -> Result<(), ContentError> {
    match of_slice.saturating_mul(slices) {
        0..=MAX_IMAGE_VOXELS => Ok(()),
        count => Err(ContentError::Invalid(format!(
            "it has {count} voxels, more than {MAX_IMAGE_VOXELS}; export a part of it"
        ))),
    }
}

/// Storage of a pixel.
struct Pixel {
    element: Element,
    /// Significant bits, and whether the highest of them is a sign.
    stored: u32,
    is_signed: bool,
}

impl Pixel {
    fn of(data: &InMemDicomObject) -> Result<Self, ContentError> {
        let samples = number(data, tags::SAMPLES_PER_PIXEL)?.unwrap_or(1.0);
        let kind = text(data, tags::PHOTOMETRIC_INTERPRETATION).unwrap_or_else(|| "MONOCHROME2".to_owned());
        if samples != 1.0 || kind != "MONOCHROME2" {
            return Err(ContentError::Invalid(format!(
                "its pixels are {} with {samples} values each; images with one grey a pixel (MONOCHROME2) are read",
                short(&kind)
            )));
        }
        let bits = needed(data, tags::BITS_ALLOCATED, 1.0, 64.0)?;
        let is_signed = number(data, tags::PIXEL_REPRESENTATION)?.unwrap_or(0.0) == 1.0;
        let element = match (bits as u32, is_signed) {
            (8, _) => Element::U8,
            (16, _) => Element::U16,
            (32, _) => Element::U32,
            _ => {
                return Err(ContentError::Invalid(format!(
                    "its pixels have {bits} bits; 8, 16 and 32 are read"
                )));
            }
        };
        let stored = number(data, tags::BITS_STORED)?.unwrap_or(bits);
        let high = number(data, tags::HIGH_BIT)?.unwrap_or(stored - 1.0);
        if !(1.0..=bits).contains(&stored) || high != stored - 1.0 {
            return Err(ContentError::Invalid(format!(
                "{stored} of its {bits} bits count, up to bit {high}; images whose bits begin at the lowest are read"
            )));
        }
        Ok(Self {
            element,
            stored: stored as u32,
            is_signed,
        })
    }

    /// Reads the values of this number of pixels.
    fn values(
        &self,
        pixels: &[u8],
        endian: Endian,
        count: usize,
        [slope, intercept]: [f64; 2],
    ) -> Result<Vec<f32>, ContentError> {
        let progress = Progress::default();
        let raw = read_values(pixels, self.element, endian, count, [1.0, 0.0], Sink::exact(&progress))?;
        // Bits above the significant ones may hold overlays.
        let kept = (1_u64 << self.stored) - 1;
        let sign = 1_u64 << (self.stored - 1);
        let value = |raw: f64| {
            let bits = raw as u64 & kept;
            let number = match self.is_signed && bits & sign != 0 {
                true => bits as f64 - (kept + 1) as f64,
                false => bits as f64,
            };
            (number * slope + intercept) as f32
        };
        Ok(raw.into_iter().map(value).collect())
    }
}

/// Reads the frames of an enhanced image: common attributes stand once, the others with each frame.
fn enhanced(object: &Object, pixels: &[u8], endian: Endian, progress: &Progress) -> Result<Vec<Frame>, ContentError> {
    let data = &object.data;
    let count = needed(data, tags::NUMBER_OF_FRAMES, 1.0, MAX_FRAMES)? as usize;
    let own = items(data, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE);
    if own.len() != count {
        return Err(ContentError::Invalid(format!(
            "it says {count} frames and describes {}; export it again",
            own.len()
        )));
    }
    let shared = items(data, tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE).first();
    let size = [tags::COLUMNS, tags::ROWS].map(|tag| needed(data, tag, 1.0, 65_535.0));
    let [columns, rows] = size;
    let size = [columns? as u64, rows? as u64];
    let pixel = Pixel::of(data)?;
    let of_frame = size[0] as usize * size[1] as usize;
    check_size(of_frame, count)?;
    let bytes = of_frame * pixel.element.bytes();
    let series = text(data, tags::SERIES_INSTANCE_UID).unwrap_or_default();
    let mut frames = Vec::new();
    for (n, groups) in own.iter().enumerate() {
        progress.report(Stage::Voxels, n, count)?;
        let group = |sequence: Tag| {
            let of = |groups: &'_ InMemDicomObject| items(groups, sequence).first().cloned();
            of(groups).or_else(|| shared.and_then(of))
        };
        let three = |sequence: Tag, tag: Tag| match group(sequence) {
            Some(item) => numbers(&item, tag),
            None => Ok(None),
        };
        let missing = |tag: Tag| ContentError::Invalid(format!("{} of frame {} is missing", name(tag), n + 1));
        let place = three(tags::PLANE_POSITION_SEQUENCE, tags::IMAGE_POSITION_PATIENT)?;
        let turn = three(tags::PLANE_ORIENTATION_SEQUENCE, tags::IMAGE_ORIENTATION_PATIENT)?;
        let pitch = three(tags::PIXEL_MEASURES_SEQUENCE, tags::PIXEL_SPACING)?;
        let (Some(&[x, y, z]), Some(&[a, b, c, d, e, f]), Some(&[between_rows, between_columns])) =
            (place.as_deref(), turn.as_deref(), pitch.as_deref())
        else {
            return Err(match (&place, &turn) {
                (None, _) if items(groups, tags::PLANE_POSITION_VOLUME_SEQUENCE).is_empty() => {
                    missing(tags::IMAGE_POSITION_PATIENT)
                }
                (None, _) => {
                    "its frames are positioned relative to the probe, not the patient; export it as NRRD".into()
                }
                (_, None) => missing(tags::IMAGE_ORIENTATION_PATIENT),
                _ => missing(tags::PIXEL_SPACING),
            });
        };
        let scale = group(tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE);
        let scale = scale.as_ref().map_or(Ok([1.0, 0.0]), scale_of)?;
        let raw = pixels.get(n * bytes..(n + 1) * bytes).ok_or_else(|| {
            ContentError::Invalid(format!(
                "it is truncated: frame {} of {count} is missing; copy or export it again",
                n + 1
            ))
        })?;
        let slice = Slice::new(
            (series.clone(), Identity::of(object)),
            Vector3::new(x, y, z),
            [
                Vector3::new(a, b, c) * between_columns,
                Vector3::new(d, e, f) * between_rows,
            ],
            size,
        );
        frames.push(Frame {
            slice,
            values: pixel.values(raw, endian, of_frame, scale)?,
        });
    }
    Ok(frames)
}

#[cfg(test)]
mod tests;
