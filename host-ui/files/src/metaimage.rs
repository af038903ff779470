//! The voxels of a MetaImage file (.mha, .mhd with its data file).

mod header;
pub mod write;

use super::DataReader;
use super::element::{Sink, must_hold, read_values, values_from_text, voxel_count};
use super::frame::VoxelFrame;
use super::nrrd::nothing_left;
use super::volume::VoxelValues;
use crate::error::ContentError;
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
    let size = (count * h.element.bytes()) as u64;
    if !h.binary {
        must_hold(count as u64, data.len() as u64, false)?;
        return values_from_text(data, count, sink);
    }
    if h.compressed {
        if h.header_bytes != 0 {
            return Err(ContentError::Invalid(
                "its data are packed and yet have a HeaderSize; write it again".to_owned(),
            ));
        }
        must_hold(size, data.len() as u64, true)?;
        let mut from = ZlibDecoder::new(data);
        let values = read_values(&mut from, h.element, h.endian, count, [1.0, 0.0], sink)?;
        nothing_left(from)?;
        return Ok(values);
    }
    let data = match h.header_bytes {
        // The data are the end of the file, after any header.
        -1 => &data[data.len().saturating_sub(size as usize)..],
        n => data.get(n as usize..).unwrap_or_default(),
    };
    must_hold(size, data.len() as u64, false)?;
    if data.len() as u64 > size {
        return Err(ContentError::Invalid(format!(
            "the header asks for {size} bytes and {} are there: header and data do not belong together; write it again",
            data.len()
        )));
    }
    read_values(data, h.element, h.endian, count, [1.0, 0.0], sink)
}

/// Returns the frame in RAS, m; the file is in LPS, mm.
fn frame(h: &Header) -> Result<VoxelFrame, ContentError> {
    let lettered = h.letters.as_deref().and_then(axes_of_letters);
    let mut warning = None;
    let directions = match (h.directions, lettered) {
        (Some(directions), lettered) => {
            if lettered.is_some_and(|l| !same_octants(&l, &directions)) {
                warning = Some(format!(
                    "AnatomicalOrientation = {} contradicts TransformMatrix, which is used",
                    h.letters.as_deref().unwrap_or_default()
                ));
            }
            directions
        }
        (None, Some(lettered)) => lettered,
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
    if h.directions.is_some() {
        let off = h.directions.map_or(0.0, |d| {
            (0..3).map(|a| (d.column(a).norm() - 1.0).abs()).fold(0.0, f64::max)
        });
        if off > 1e-3 {
            return Err(ContentError::Invalid(
                "its TransformMatrix scales as well as it turns; write it with unit vectors".to_owned(),
            ));
        }
    }
    frame.warning = warning;
    Ok(frame)
}

/// Returns the axes by letters, which name the origin of each: RAI points left, posterior,
/// superior.
fn axes_of_letters(letters: &str) -> Option<Matrix3<f64>> {
    let mut axes = Matrix3::zeros();
    let mut seen = [false; 3];
    for (column, letter) in letters.chars().enumerate() {
        let (row, sign) = match letter {
            'R' => (0, 1.0),
            'L' => (0, -1.0),
            'A' => (1, 1.0),
            'P' => (1, -1.0),
            'I' => (2, 1.0),
            'S' => (2, -1.0),
            _ => return None,
        };
        if column > 2 || std::mem::replace(&mut seen[row], true) {
            return None;
        }
        axes[(row, column)] = sign;
    }
    (seen == [true; 3]).then_some(axes)
}

/// Returns whether the main direction of each axis agrees with the letters.
fn same_octants(lettered: &Matrix3<f64>, directions: &Matrix3<f64>) -> bool {
    (0..3).all(|a| lettered.column(a).dot(&directions.column(a)) > 0.5)
}

#[cfg(test)]
mod tests;
