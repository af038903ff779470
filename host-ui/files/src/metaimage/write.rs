//! A label volume as MetaImage, a format without names of structures.

use super::super::volume::Voxels;
use crate::error::ContentError;
use flate2::{Compression, write::ZlibEncoder};
use std::io::Write;
use stylet_anatomy::ras_from_lps;

/// Returns the bytes of the file, packed, in LPS.
pub fn bytes(v: &Voxels) -> Result<Vec<u8>, ContentError> {
    let cannot = |e: std::io::Error| format!("the labels cannot be packed ({e})");
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::default());
    packed.write_all(&v.labels).map_err(cannot)?;
    let packed = packed.finish().map_err(cannot)?;
    let matrix: Vec<String> = (0..3)
        .flat_map(|a| ras_from_lps(v.frame.directions.column(a).into()).data.0[0])
        .map(|c| c.to_string())
        .collect();
    let origin = ras_from_lps(v.frame.origin_m) * 1e3;
    let spacing = v.frame.spacing_m.map(|s| s * 1e3);
    let mut out = format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = True\n\
         CompressedDataSize = {}\nTransformMatrix = {}\nOffset = {} {} {}\nCenterOfRotation = 0 0 0\n\
         ElementSpacing = {} {} {}\nDimSize = {} {} {}\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n",
        packed.len(),
        matrix.join(" "),
        origin.x,
        origin.y,
        origin.z,
        spacing[0],
        spacing[1],
        spacing[2],
        v.dims[0],
        v.dims[1],
        v.dims[2],
    )
    .into_bytes();
    out.extend(packed);
    Ok(out)
}
