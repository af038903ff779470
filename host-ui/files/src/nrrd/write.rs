//! A label volume as NRRD, with Slicer's names of segments.

use super::super::dicom::Identity;
use super::super::volume::Voxels;
use crate::error::ContentError;
use flate2::{Compression, write::GzEncoder};
use nalgebra::Vector3;
use std::io::Write;

/// Returns the bytes of the file, packed, with patient and frame of reference in its header.
pub fn bytes(v: &Voxels, identity: Option<&Identity>) -> Result<Vec<u8>, ContentError> {
    let vector = |c: Vector3<f64>| format!("({},{},{})", c.x * 1e3, c.y * 1e3, c.z * 1e3);
    let columns = v.frame.columns_m();
    // In LPS, like nearly all files.
    let lps = stylet_anatomy::ras_from_lps;
    let directions: Vec<String> = (0..3).map(|a| vector(lps(columns.column(a).into()))).collect();
    let mut out = format!(
        "NRRD0004\ntype: unsigned char\ndimension: 3\nspace: left-posterior-superior\nsizes: {} {} {}\n\
         space directions: {}\nkinds: domain domain domain\nendian: little\nencoding: gzip\nspace origin: {}\n",
        v.dims[0],
        v.dims[1],
        v.dims[2],
        directions.join(" "),
        vector(lps(v.frame.origin_m))
    );
    for (n, (label, name)) in v.names.iter().enumerate() {
        let name: String = name.chars().filter(|c| !c.is_control()).collect();
        out.push_str(&format!(
            "Segment{n}_ID:=Segment_{label}\nSegment{n}_Name:={name}\nSegment{n}_LabelValue:={label}\nSegment{n}_Layer:=0\n"
        ));
    }
    out += &identity.map(Identity::pairs).unwrap_or_default();
    out.push('\n');
    let mut packed = GzEncoder::new(out.into_bytes(), Compression::default());
    // The header stays unpacked: only bytes written from here on are packed.
    packed
        .write_all(&v.labels)
        .and_then(|()| packed.finish())
        .map_err(|e| format!("the labels cannot be packed ({e})").into())
}
