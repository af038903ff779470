//! The voxels of a NIfTI-1 file (.nii, .nii.gz); every value of its header is checked.

pub mod write;

use super::affine::voxel_frame;
use super::element::{Element, Endian, Sink, must_hold, read_values, skip_bytes, voxel_count};
use super::volume::VoxelValues;
use crate::error::{ContentError, invalid};
use flate2::read::MultiGzDecoder;
use nifti::{Endianness, NiftiHeader, NiftiType};
use std::io::Read;

const HEADER_BYTES: usize = 348;
const MAX_VOX_OFFSET: f32 = 16_777_216.0;
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Returns whether the first bytes are those of such a file, packed or not.
pub fn is_nifti(bytes: &[u8]) -> bool {
    bytes.starts_with(&GZIP) || declared_size(bytes).is_some_and(|n| n == 348 || n == 540)
}

fn declared_size(bytes: &[u8]) -> Option<i32> {
    let first: [u8; 4] = bytes.get(..4)?.try_into().ok()?;
    let (little, big) = (i32::from_le_bytes(first), i32::from_be_bytes(first));
    Some(if [348, 540].contains(&big) { big } else { little })
}

/// Reads the whole file, packed or not.
pub fn read<V>(bytes: &[u8], sink: Sink<V>) -> Result<VoxelValues<V>, ContentError> {
    let packed = bytes.starts_with(&GZIP);
    let mut from: Box<dyn Read + '_> = if packed {
        Box::new(MultiGzDecoder::new(bytes))
    } else {
        Box::new(bytes)
    };
    let header = read_header(&mut from, bytes.len())?;
    let dims = checked_dims(&header)?;
    let element = element(&header)?;
    let data_at = data_at(&header)?;
    let count = voxel_count(&dims.map(|d| d as u64))?;
    must_hold((data_at + count * element.bytes()) as u64, bytes.len() as u64, packed)?;
    let frame = voxel_frame(&header)?;
    skip_bytes(&mut from, (data_at - HEADER_BYTES) as u64)?;
    let endian = if header.endianness == Endianness::Big {
        Endian::Big
    } else {
        Endian::Little
    };
    let values = read_values(from, element, endian, count, scale(&header), sink)?;
    Ok(VoxelValues { dims, values, frame })
}

fn read_header(from: &mut dyn Read, file_bytes: usize) -> Result<NiftiHeader, ContentError> {
    let mut start = Vec::with_capacity(HEADER_BYTES);
    from.take(HEADER_BYTES as u64)
        .read_to_end(&mut start)
        .map_err(|e| format!("it is gzip data that cannot be unpacked ({e}); copy or export it again"))?;
    if declared_size(&start) == Some(540) {
        return Err("it is NIfTI-2; convert it to NIfTI-1".into());
    }
    if start.len() < HEADER_BYTES {
        return Err(invalid!(
            "it is truncated: {file_bytes} bytes, and the header alone needs {HEADER_BYTES}; copy or export it again"
        ));
    }
    if start.ends_with(b"ni1\0") {
        return Err("it is the header of a .hdr/.img pair; convert it to one .nii file".into());
    }
    if !start.ends_with(b"n+1\0") {
        return Err(
            "its magic is not \"n+1\", so it is not a NIfTI-1 file; export the segmentation as NIfTI-1 (.nii or .nii.gz)"
                .into(),
        );
    }
    NiftiHeader::from_reader(start.as_slice())
        .map_err(|e| format!("its header cannot be read ({e}); export the segmentation as NIfTI-1 again").into())
}

fn checked_dims(h: &NiftiHeader) -> Result<[usize; 3], ContentError> {
    let rank = usize::from(h.dim[0]);
    if !(3..=7).contains(&rank) {
        return Err(invalid!("it has {rank} dimensions; a segmentation has 3"));
    }
    let dims = [1, 2, 3].map(|a| usize::from(h.dim[a]));
    if dims.contains(&0) || dims.iter().any(|&d| d > 32767) {
        return Err(invalid!(
            "its size is {} x {} x {} voxels; each must be 1 to 32767",
            dims[0],
            dims[1],
            dims[2]
        ));
    }
    if h.dim[4..=rank].iter().any(|&d| d != 1) {
        return Err(invalid!(
            "it contains a series of volumes ({:?}); take one volume out of it",
            &h.dim[1..=rank]
        ));
    }
    Ok(dims)
}

fn element(h: &NiftiHeader) -> Result<Element, ContentError> {
    Ok(match h.data_type() {
        Ok(NiftiType::Uint8) => Element::U8,
        Ok(NiftiType::Int8) => Element::I8,
        Ok(NiftiType::Uint16) => Element::U16,
        Ok(NiftiType::Int16) => Element::I16,
        Ok(NiftiType::Uint32) => Element::U32,
        Ok(NiftiType::Int32) => Element::I32,
        Ok(NiftiType::Uint64) => Element::U64,
        Ok(NiftiType::Int64) => Element::I64,
        Ok(NiftiType::Float32) => Element::F32,
        Ok(NiftiType::Float64) => Element::F64,
        _ => {
            return Err(invalid!(
                "its data type is number {}; labels must be whole numbers (uint8 is best)",
                h.datatype
            ));
        }
    })
}

fn data_at(h: &NiftiHeader) -> Result<usize, ContentError> {
    if (352.0..=MAX_VOX_OFFSET).contains(&h.vox_offset) {
        return Ok(h.vox_offset as usize);
    }
    Err(invalid!(
        "its voxels begin at byte {}; expected 352 or a little more",
        h.vox_offset
    ))
}

/// Returns the scaling; in the standard, a slope of 0 means none.
fn scale(h: &NiftiHeader) -> [f64; 2] {
    let (slope, intercept) = (f64::from(h.scl_slope), f64::from(h.scl_inter));
    if slope == 0.0 || !slope.is_finite() || !intercept.is_finite() {
        return [1.0, 0.0];
    }
    [slope, intercept]
}

#[cfg(test)]
mod tests;
