//! The orientation in a NIfTI header.

use super::frame::VoxelFrame;
use crate::error::ContentError;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use nifti::NiftiHeader;

/// Distance at every corner below which two orientations count as one.
const SAME_MM: f64 = 0.1;

/// Returns the frame of the voxels, from the sform, or else the qform.
pub fn voxel_frame(h: &NiftiHeader) -> Result<VoxelFrame, ContentError> {
    let (unit_m, unknown_unit) = match h.xyzt_units & 7 {
        1 => (1.0, false),
        2 => (1e-3, false),
        3 => (1e-6, false),
        _ => (1e-3, true),
    };
    let differs_mm = differs_m(h).map(|m| m * unit_m * 1e3);
    let (columns, origin, source) = if h.sform_code > 0 {
        sform(h)
    } else if h.qform_code > 0 {
        qform(h)
    } else {
        let columns = Matrix3::from_diagonal(&Vector3::from(pixdim(h)));
        (columns, Vector3::zeros(), "pixdim")
    };
    let mut frame = VoxelFrame::new(columns * unit_m, origin * unit_m, source)?;
    if source == "pixdim" {
        frame.warning = Some(
            "the file does not give the patient's orientation (sform and qform are 0); +x, +y, +z are taken as right, anterior, superior"
                .to_owned(),
        );
    } else if unknown_unit {
        frame.warning = Some("the file names no unit of length; mm is assumed".to_owned());
    }
    // NaN compares false, and is no reason to reject the sform.
    if let Some(mm) = differs_mm.filter(|mm| *mm > SAME_MM) {
        let note = format!(
            "its sform and its qform differ, by {mm:.2} mm at a corner of the volume; the sform counts. Is it the one of this patient?"
        );
        frame.warning = Some(frame.warning.map_or(note.clone(), |other| format!("{other}; {note}")));
    }
    Ok(frame)
}

/// Returns the distance between the corners of a volume in its two orientations, in its unit;
/// `None` if it has only one.
fn differs_m(h: &NiftiHeader) -> Option<f64> {
    if h.sform_code <= 0 || h.qform_code <= 0 {
        return None;
    }
    let ((s, s_origin, _), (q, q_origin, _)) = (sform(h), qform(h));
    let corner = |n: usize| {
        let last = |a: usize| f64::from(h.dim[a + 1].max(1) - 1) * (n >> a & 1) as f64;
        Vector3::new(last(0), last(1), last(2))
    };
    let off = |n: usize| (s * corner(n) + s_origin - q * corner(n) - q_origin).norm();
    Some((0..8).map(off).fold(0.0, f64::max))
}

fn pixdim(h: &NiftiHeader) -> [f64; 3] {
    [1, 2, 3].map(|a| f64::from(h.pixdim[a]).abs())
}

fn sform(h: &NiftiHeader) -> (Matrix3<f64>, Vector3<f64>, &'static str) {
    let row = |r: [f32; 4]| r.map(f64::from);
    let (x, y, z) = (row(h.srow_x), row(h.srow_y), row(h.srow_z));
    let m = Matrix3::new(x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]);
    (m, Vector3::new(x[3], y[3], z[3]), "sform")
}

fn qform(h: &NiftiHeader) -> (Matrix3<f64>, Vector3<f64>, &'static str) {
    let [b, c, d] = [h.quatern_b, h.quatern_c, h.quatern_d].map(f64::from);
    let a = (1.0 - b * b - c * c - d * d).max(0.0).sqrt();
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(a, b, c, d)).to_rotation_matrix();
    let mut sides = pixdim(h);
    if h.pixdim[0] < 0.0 {
        sides[2] = -sides[2];
    }
    let m = rotation.matrix() * Matrix3::from_diagonal(&Vector3::from(sides));
    let origin = [h.quatern_x, h.quatern_y, h.quatern_z].map(f64::from);
    (m, Vector3::from(origin), "qform")
}
