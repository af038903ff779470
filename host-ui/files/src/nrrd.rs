//! The voxels of an NRRD file (.nrrd, .nhdr with its data file, Slicer's .seg.nrrd).

mod header;
pub mod segments;
pub mod write;

use super::DataReader;
use super::element::{Element, Endian, Sink, Stored, voxel_count};
use super::frame::VoxelFrame;
use super::volume::{VoxelValues, Voxels};
use crate::error::{ContentError, invalid};
use flate2::read::MultiGzDecoder;
use header::{Axis, Header};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;

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
        Some(list) => Err(invalid!(
            "it has {} values for each voxel; save one of them as a volume",
            header.sizes[list]
        )),
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
    let is_text = ["ascii", "text", "txt"].contains(&encoding);
    if h.element.bytes() > 1 && h.endian.is_none() && !is_text {
        return Err("it does not say in which order the bytes of a number are: the field \"endian\" is missing".into());
    }
    let data = skip_lines(data, h.line_skip)?;
    let stored = Stored {
        element: h.element,
        endian: h.endian.unwrap_or(Endian::Little),
        count,
    };
    match encoding {
        _ if is_text => stored.text(data, sink),
        "raw" => stored.raw(data, h.byte_skip, sink),
        "gzip" | "gz" => {
            let skip =
                u64::try_from(h.byte_skip).map_err(|_| "its data are packed, and its byte skip is -1; unpack them")?;
            stored.packed(MultiGzDecoder::new(data), data.len(), skip, sink)
        }
        other => Err(invalid!(
            "its encoding \"{}\" is not read; save it with gzip, raw or text encoding",
            super::element::short(other)
        )),
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

const NO_SPACE: &str = "the file names no anatomical space; its axes are taken as right, anterior, superior";

/// Returns the frame in RAS, m.
fn frame(h: &Header, space: [usize; 3]) -> Result<VoxelFrame, ContentError> {
    let (flip, named) = match h.space.as_deref() {
        Some("right-anterior-superior" | "ras") => ([1.0, 1.0, 1.0], true),
        Some("left-anterior-superior" | "las") => ([-1.0, 1.0, 1.0], true),
        Some("left-posterior-superior" | "lps") => ([-1.0, -1.0, 1.0], true),
        Some("scanner-xyz" | "3d-right-handed" | "3d-left-handed") | None => ([1.0, 1.0, 1.0], false),
        Some(other) => {
            return Err(invalid!(
                "its space \"{}\" is not an anatomical space; save it as left-posterior-superior or right-anterior-superior",
                super::element::short(other)
            ));
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
