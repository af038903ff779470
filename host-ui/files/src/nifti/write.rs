//! A label volume as NIfTI-1 (.nii.gz), with sform and qform from its frame; the format has no
//! names of structures.

use super::super::volume::Voxels;
use crate::error::{ContentError, invalid};
use flate2::{Compression, write::GzEncoder};
use std::io::Write;

const SFORM_ALIGNED: i16 = 2;
const UINT8: i16 = 2;
const MILLIMETRES: u8 = 2;
const DATA_AT: usize = 352;

/// Returns the bytes of the file, packed. Offsets in the header are the standard's.
pub fn bytes(v: &Voxels) -> Result<Vec<u8>, ContentError> {
    if v.dims.iter().any(|&d| d > 32767) {
        return Err(invalid!(
            "NIfTI-1 holds at most 32767 voxels along an axis, and there are {:?}",
            v.dims
        ));
    }
    let mut b = vec![0_u8; DATA_AT];
    let mut put = |at: usize, bytes: &[u8]| b[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348_i32.to_le_bytes());
    for (i, d) in [3, v.dims[0], v.dims[1], v.dims[2], 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &(d as i16).to_le_bytes());
    }
    put(70, &UINT8.to_le_bytes());
    put(72, &8_i16.to_le_bytes());
    let sides = v.frame.spacing_m.map(|s| s * 1e3);
    for (i, side) in [1.0, sides[0], sides[1], sides[2]].into_iter().enumerate() {
        put(76 + 4 * i, &(side as f32).to_le_bytes());
    }
    put(108, &(DATA_AT as f32).to_le_bytes());
    put(112, &1.0_f32.to_le_bytes());
    put(123, &[MILLIMETRES]);
    put(254, &SFORM_ALIGNED.to_le_bytes());
    let columns = v.frame.columns_m() * 1e3;
    let origin = v.frame.origin_m * 1e3;
    for r in 0..3 {
        let row = [columns[(r, 0)], columns[(r, 1)], columns[(r, 2)], origin[r]];
        for (c, value) in row.into_iter().enumerate() {
            put(280 + 16 * r + 4 * c, &(value as f32).to_le_bytes());
        }
    }
    put(344, b"n+1\0");
    let mut packed = GzEncoder::new(Vec::new(), Compression::default());
    packed
        .write_all(&b)
        .and_then(|()| packed.write_all(&v.labels))
        .and_then(|()| packed.finish())
        .map_err(|e| format!("the labels cannot be packed ({e})").into())
}
