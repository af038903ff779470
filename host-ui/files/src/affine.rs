//! The orientation that a NIfTI header gives.

use super::frame::VoxelFrame;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use nifti::NiftiHeader;

pub fn voxel_frame(h: &NiftiHeader) -> Result<VoxelFrame, String> {
    let (unit_m, unknown_unit) = match h.xyzt_units & 7 {
        1 => (1.0, false),
        2 => (1e-3, false),
        3 => (1e-6, false),
        _ => (1e-3, true),
    };
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
            "the file says nothing of the patient's orientation (sform and qform are 0); +x, +y, +z are taken as right, anterior, superior"
                .to_owned(),
        );
    } else if unknown_unit {
        frame.warning = Some("the file names no unit of length; mm is assumed".to_owned());
    }
    Ok(frame)
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
