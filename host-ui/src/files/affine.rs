//! Where the voxels of a NIfTI file lie in the patient (RAS, m).

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use nifti::NiftiHeader;

/// Axes whose cosine is larger are sheared.
const SHEAR: f64 = 1e-3;

/// `patient = directions * (spacing_m .* index) + origin_m`, index at voxel centres.
#[derive(Clone, Debug)]
pub struct VoxelFrame {
    /// Orthonormal; mirrored when its determinant is negative.
    pub directions: Matrix3<f64>,
    pub spacing_m: [f64; 3],
    pub origin_m: Vector3<f64>,
    pub warning: Option<String>,
}

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
    let (columns, origin_m) = (columns * unit_m, origin * unit_m);
    if !columns.iter().chain(origin_m.iter()).all(|v| v.is_finite()) {
        return Err(format!(
            "its {source} holds a value that is not a number; write the file again with a valid orientation"
        ));
    }
    let spacing_m: [f64; 3] = [0, 1, 2].map(|a| columns.column(a).norm());
    if spacing_m.iter().any(|s| !(1e-5..=0.1).contains(s)) {
        let mm = spacing_m.map(|s| s * 1e3);
        return Err(format!(
            "its {source} gives voxels of {:.4} x {:.4} x {:.4} mm; each side must be 0.01 to 100 mm",
            mm[0], mm[1], mm[2]
        ));
    }
    if origin_m.amax() > 10.0 {
        return Err(format!(
            "its {source} puts the first voxel {:.1} m from the origin; at most 10 m is believed",
            origin_m.amax()
        ));
    }
    let raw = Matrix3::from_columns(&[0, 1, 2].map(|a| columns.column(a) / spacing_m[a]));
    let worst = [(0, 1), (0, 2), (1, 2)]
        .map(|(a, b)| raw.column(a).dot(&raw.column(b)).abs())
        .into_iter()
        .fold(0.0, f64::max);
    if worst > SHEAR {
        return Err(format!(
            "its {source} is sheared (axes {:.2} deg off a right angle); resample it to a rectangular grid first",
            worst.min(1.0).asin().to_degrees()
        ));
    }
    let mut warning = (source == "pixdim").then(|| {
        "the file says nothing of the patient's orientation (sform and qform are 0); +x, +y, +z are taken as right, anterior, superior"
            .to_owned()
    });
    if unknown_unit && warning.is_none() {
        warning = Some("the file names no unit of length; mm is assumed".to_owned());
    }
    Ok(VoxelFrame {
        directions: nearest_orthonormal(raw),
        spacing_m,
        origin_m,
        warning,
    })
}

/// Single precision leaves the columns a little off.
fn nearest_orthonormal(m: Matrix3<f64>) -> Matrix3<f64> {
    let svd = m.svd(true, true);
    match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => u * v_t,
        _ => m,
    }
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
