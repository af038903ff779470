//! The voxels of a MetaImage file (.mha, .mhd with its data file).

mod header;
pub mod write;

use super::DataReader;
use super::element::{Sink, Stored, short, voxel_count};
use super::frame::VoxelFrame;
use super::volume::VoxelValues;
use crate::error::{ContentError, invalid};
use flate2::read::ZlibDecoder;
use header::Header;
use nalgebra::{Matrix3, Vector3};
use stylet_anatomy::ras_from_lps;

/// Possible first keys of such a file.
const FIRST: [&str; 8] = [
    "ObjectType",
    "NDims",
    "Comment",
    "ObjectSubType",
    "Name",
    "ID",
    "TransformType",
    "BinaryData",
];

/// Returns whether the bytes begin like a MetaImage header.
pub fn is_metaimage(bytes: &[u8]) -> bool {
    let line = bytes.split(|&b| b == b'\n').next().unwrap_or_default();
    let Ok(line) = std::str::from_utf8(line) else {
        return false;
    };
    line.split_once('=').is_some_and(|(key, _)| FIRST.contains(&key.trim()))
}

/// Reads the whole file; `data_file` reads the data of a detached header.
pub fn read<V>(bytes: &[u8], data_file: DataReader, sink: Sink<V>) -> Result<VoxelValues<V>, ContentError> {
    let (header, rest) = Header::parse(bytes)?;
    let frame = frame(&header)?;
    let count = voxel_count(&header.sizes)?;
    let detached;
    let data = if header.data_file.eq_ignore_ascii_case("LOCAL") {
        rest
    } else {
        detached = data_file(&header.data_file)?;
        &detached
    };
    Ok(VoxelValues {
        dims: [0, 1, 2].map(|a| header.sizes[a] as usize),
        values: read_data(&header, data, count, sink)?,
        frame,
    })
}

fn read_data<V>(h: &Header, data: &[u8], count: usize, sink: Sink<V>) -> Result<Vec<V>, ContentError> {
    let stored = Stored {
        element: h.element,
        endian: h.endian,
        count,
    };
    match (h.binary, h.compressed) {
        (false, _) => stored.text(data, sink),
        (true, false) => stored.raw(data, h.header_bytes, sink),
        (true, true) if h.header_bytes == 0 => stored.packed(ZlibDecoder::new(data), data.len(), 0, sink),
        (true, true) => Err("its data are packed and yet have a HeaderSize; write it again".into()),
    }
}

/// Returns the frame in RAS, m; the file is in LPS, mm.
fn frame(h: &Header) -> Result<VoxelFrame, ContentError> {
    let mut warning = None;
    let directions = match (h.directions, h.letters.as_deref()) {
        (Some(directions), _) => directions,
        // The origins of the axes: left, posterior and superior are positive.
        (None, Some("RAI")) => Matrix3::identity(),
        (None, Some(letters)) => {
            return Err(invalid!(
                "its AnatomicalOrientation {} stands without a TransformMatrix; write it with one",
                short(letters)
            ));
        }
        (None, None) => {
            warning = Some(
                "the file does not give the patient's orientation; its axes are taken as left, posterior, superior"
                    .to_owned(),
            );
            Matrix3::identity()
        }
    };
    let columns = directions * Matrix3::from_diagonal(&Vector3::from(h.spacing_mm)) * 1e-3;
    let turned = Matrix3::from_columns(&[0, 1, 2].map(|a| ras_from_lps(columns.column(a).into())));
    let origin = ras_from_lps(Vector3::from(h.origin_mm) * 1e-3);
    let mut frame = VoxelFrame::new(turned, origin, "TransformMatrix and ElementSpacing")?;
    let scales = |axis: usize| h.directions.is_some_and(|d| (d.column(axis).norm() - 1.0).abs() > 1e-3);
    if (0..3).any(scales) {
        return Err("its TransformMatrix scales as well as it turns; write it with unit vectors".into());
    }
    frame.warning = warning;
    Ok(frame)
}

#[cfg(test)]
mod tests;
