//! The voxels of an NRRD file (.nrrd, .nhdr with its data file, Slicer's .seg.nrrd).

mod header;
pub mod segments;
pub mod write;

use super::DataReader;
use super::element::{Element, Endian, Sink, must_hold, read_values, values_from_text, voxel_count};
use super::frame::VoxelFrame;
use super::volume::{VoxelValues, Voxels};
use crate::error::ContentError;
use flate2::read::MultiGzDecoder;
use header::{Axis, Header};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use std::io::Read;

/// Most bytes that a "byte skip" of -1 skips.
const MAX_BEFORE_END: u64 = 1 << 20;

/// Returns whether the bytes begin like an NRRD file.
pub fn is_nrrd(bytes: &[u8]) -> bool {
    bytes.starts_with(b"NRRD000")
}

/// Reads a file as labels; `data_file` reads the data of a detached header.
pub fn read(bytes: &[u8], data_file: DataReader, sink: Sink<u8>) -> Result<Voxels, ContentError> {
    let (header, voxels) = open(bytes, data_file, sink)?;
    match list_axis(&header)? {
        None => Ok(voxels.named(segments::names(&header.pairs)?)),
        Some(list) => segments::flatten(&header, &voxels.values, list, voxels.frame, voxels.dims),
    }
}

/// Reads a file as an image.
pub fn read_image<V>(bytes: &[u8], data_file: DataReader, sink: Sink<V>) -> Result<VoxelValues<V>, ContentError> {
    let (header, voxels) = open(bytes, data_file, sink)?;
    match list_axis(&header)? {
        None => Ok(voxels),
        Some(list) => Err(ContentError::Invalid(format!(
            "it has {} values for each voxel; save one of them as a volume",
            header.sizes[list]
        ))),
    }
}

/// Returns the axis along which a voxel has several values.
fn list_axis(h: &Header) -> Result<Option<usize>, ContentError> {
    let space = h.space_axes()?;
    let list = (0..h.sizes.len()).find(|a| !space.contains(a));
    Ok(list.filter(|&a| h.sizes[a] > 1))
}

/// Reads the whole file, all values of all voxels.
fn open<V>(bytes: &[u8], data_file: DataReader, sink: Sink<V>) -> Result<(Header, VoxelValues<V>), ContentError> {
    let (header, rest) = Header::parse(bytes)?;
    let space = header.space_axes()?;
    let frame = frame(&header, space)?;
    let count = voxel_count(&header.sizes)?;
    let detached;
    let data = match &header.data_file {
        None => rest,
        Some(name) => {
            detached = data_file(name)?;
            &detached
        }
    };
    let values = read_data(&header, data, count, sink)?;
    let dims = space.map(|a| header.sizes[a] as usize);
    Ok((header, VoxelValues { dims, values, frame }))
}

fn read_data<V>(h: &Header, data: &[u8], count: usize, sink: Sink<V>) -> Result<Vec<V>, ContentError> {
    let encoding = h.encoding.as_str();
    let endian = h.endian.unwrap_or(Endian::Little);
    if h.element.bytes() > 1 && h.endian.is_none() && ["raw", "gzip", "gz", "hex"].contains(&encoding) {
        return Err("it does not say in which order the bytes of a number are: the field \"endian\" is missing".into());
    }
    let skipped = skip_lines(data, h.line_skip)?;
    let size = (count * h.element.bytes()) as u64;
    let identity = [1.0, 0.0];
    match encoding {
        "raw" => {
            let data = match h.byte_skip {
                // The data are the end of the file, after any header.
                -1 => &skipped[skipped.len().saturating_sub(size as usize)..],
                n => skipped.get(n as usize..).unwrap_or_default(),
            };
            exactly(size, data.len() as u64)?;
            read_values(data, h.element, endian, count, identity, sink)
        }
        "gzip" | "gz" => {
            if h.byte_skip == -1 {
                let end = unpacked_end(skipped, size)?;
                return read_values(end.as_slice(), h.element, endian, count, identity, sink);
            }
            must_hold(size.saturating_add(h.byte_skip as u64), skipped.len() as u64, true)?;
            let mut from = MultiGzDecoder::new(skipped);
            std::io::copy(&mut from.by_ref().take(h.byte_skip as u64), &mut std::io::sink())
                .map_err(|e| format!("it is truncated or damaged ({e}); copy or export it again"))?;
            let values = read_values(&mut from, h.element, endian, count, identity, sink)?;
            nothing_left(from)?;
            Ok(values)
        }
        "ascii" | "text" | "txt" => {
            must_hold(count as u64, skipped.len() as u64, false)?;
            values_from_text(skipped, count, sink)
        }
        "hex" => {
            let bytes = unhex(skipped)?;
            exactly(size, bytes.len() as u64)?;
            read_values(bytes.as_slice(), h.element, endian, count, identity, sink)
        }
        "bzip2" | "bz2" => Err(ContentError::Invalid(
            "its data are packed with bzip2; save it with gzip or raw encoding".to_owned(),
        )),
        other => Err(ContentError::Invalid(format!(
            "its encoding \"{}\" is not known; save it with gzip, raw, text or hex encoding",
            super::element::short(other)
        ))),
    }
}

/// Returns the last bytes of packed data; a header of another format may precede them.
fn unpacked_end(packed: &[u8], size: u64) -> Result<Vec<u8>, ContentError> {
    must_hold(size, packed.len() as u64, true)?;
    let mut all = Vec::new();
    MultiGzDecoder::new(packed)
        .take(size + MAX_BEFORE_END + 1)
        .read_to_end(&mut all)
        .map_err(|e| format!("it is truncated or damaged ({e}); copy or export it again"))?;
    let before = (all.len() as u64).checked_sub(size);
    match before {
        Some(before) if before <= MAX_BEFORE_END => Ok(all.split_off(before as usize)),
        Some(_) => Err(ContentError::Invalid(format!(
            "its data have more than {MAX_BEFORE_END} bytes before those that its size requires"
        ))),
        None => Err(ContentError::Invalid(format!(
            "it is truncated: {} of {size} bytes are there; copy or export it again",
            all.len()
        ))),
    }
}

fn exactly(needed: u64, have: u64) -> Result<(), ContentError> {
    must_hold(needed, have, false)?;
    if have > needed {
        return Err(ContentError::Invalid(format!(
            "the header asks for {needed} bytes and {have} are there: header and data do not belong together; export it again"
        )));
    }
    Ok(())
}

/// Refuses a stream that is longer than the header says: it belongs to another volume.
pub(super) fn nothing_left(mut from: impl Read) -> Result<(), ContentError> {
    match from.read(&mut [0]) {
        Ok(0) => Ok(()),
        Ok(_) => Err(ContentError::Invalid(
            "its data continue beyond the size in its header: header and data do not belong together".to_owned(),
        )),
        Err(e) => Err(ContentError::Invalid(format!(
            "it is damaged ({e}); copy or export it again"
        ))),
    }
}

fn skip_lines(mut data: &[u8], lines: usize) -> Result<&[u8], ContentError> {
    for _ in 0..lines {
        let end = data
            .iter()
            .position(|&b| b == b'\n')
            .ok_or_else(|| format!("its \"line skip\" is {lines}, more lines than there are"))?;
        data = &data[end + 1..];
    }
    Ok(data)
}

fn unhex(text: &[u8]) -> Result<Vec<u8>, ContentError> {
    let digit = |b: u8| (b as char).to_digit(16).map(|d| d as u8);
    let digits: Option<Vec<u8>> = text
        .iter()
        .filter(|b| !b.is_ascii_whitespace())
        .map(|&b| digit(b))
        .collect();
    let digits = digits.ok_or("its data contain a character that is not a hexadecimal digit")?;
    if digits.len() % 2 == 1 {
        return Err(ContentError::Invalid("its data have half a byte too many".to_owned()));
    }
    Ok(digits.chunks_exact(2).map(|d| d[0] << 4 | d[1]).collect())
}

const NO_SPACE: &str = "the file names no anatomical space; its axes are taken as right, anterior, superior";

/// Returns the frame in RAS, m.
fn frame(h: &Header, space: [usize; 3]) -> Result<VoxelFrame, ContentError> {
    let (flip, named) = match h.space.as_deref() {
        Some("right-anterior-superior" | "ras") => ([1.0, 1.0, 1.0], true),
        Some("left-anterior-superior" | "las") => ([-1.0, 1.0, 1.0], true),
        Some("left-posterior-superior" | "lps") => ([-1.0, -1.0, 1.0], true),
        Some("scanner-xyz" | "3d-right-handed" | "3d-left-handed") | None => ([1.0, 1.0, 1.0], false),
        Some(other) => {
            return Err(ContentError::Invalid(format!(
                "its space \"{}\" is not an anatomical space; save it as left-posterior-superior or right-anterior-superior",
                super::element::short(other)
            )));
        }
    };
    let flip = Matrix3::from_diagonal(&Vector3::from(flip));
    let mut columns = Matrix3::zeros();
    let mut turned = true;
    for (column, axis) in space.into_iter().enumerate() {
        let step = match h.axes.get(axis) {
            Some(Axis::Direction(d)) => Vector3::from(*d),
            Some(Axis::Spacing(s)) => {
                turned = false;
                let mut step = Vector3::zeros();
                step[column] = *s;
                step
            }
            _ => {
                return Err(
                    "it does not give the size of its voxels: neither \"space directions\" nor \"spacings\"".into(),
                );
            }
        };
        columns.set_column(column, &step);
    }
    let unit = Matrix3::from_diagonal(&Vector3::from(h.units_m));
    let origin = Vector3::from(h.origin.unwrap_or_default());
    let source = if turned { "space directions" } else { "spacings" };
    let mut frame = VoxelFrame::new(flip * unit * columns, flip * unit * origin, source)?;
    if !named || !turned {
        frame.warning = Some(NO_SPACE.to_owned());
    } else if h.origin.is_none() {
        frame.warning = Some("the file names no space origin; its first voxel is taken as the origin".to_owned());
    }
    Ok(frame)
}

/// Returns the type for one of its many NRRD names.
fn element(name: &str) -> Option<Element> {
    Some(match name {
        "signed char" | "int8" | "int8_t" => Element::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Element::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Element::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Element::U16,
        "int" | "signed int" | "int32" | "int32_t" => Element::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Element::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Element::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Element::U64,
        "float" => Element::F32,
        "double" => Element::F64,
        _ => return None,
    })
}

/// Key and value pairs of a header, in which Slicer keeps its segments.
type Pairs = BTreeMap<String, String>;

#[cfg(test)]
mod tests;
