//! The place of a file's voxels in the patient (RAS, m), for any format.

use crate::error::{ContentError, invalid};
use nalgebra::{Matrix3, Vector3};

/// Largest cosine between two axes; beyond it they are sheared.
const SHEAR: f64 = 1e-3;

/// Frame of voxels: `patient = directions * (spacing_m .* index) + origin_m`, index at voxel
/// centres.
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelFrame {
    /// Directions, orthonormal; mirrored if the determinant is negative.
    pub directions: Matrix3<f64>,
    /// Distance between voxels along each axis, in m.
    pub spacing_m: [f64; 3],
    /// Centre of the first voxel, in m.
    pub origin_m: Vector3<f64>,
    /// Remark for the user on the origin of the frame.
    pub warning: Option<String>,
}

impl VoxelFrame {
    /// Creates a frame from the steps between voxels along each axis, one a column, and the centre
    /// of the first voxel (RAS, m); `source` is the file's term for them.
    pub fn new(columns_m: Matrix3<f64>, origin_m: Vector3<f64>, source: &str) -> Result<Self, ContentError> {
        if !columns_m.iter().chain(origin_m.iter()).all(|v| v.is_finite()) {
            return Err(invalid!(
                "its {source} contains a value that is not a number; write the file again with a valid orientation"
            ));
        }
        let spacing_m: [f64; 3] = [0, 1, 2].map(|a| columns_m.column(a).norm());
        if spacing_m.iter().any(|s| !(1e-5..=0.1).contains(s)) {
            let mm = spacing_m.map(|s| s * 1e3);
            return Err(invalid!(
                "its {source} gives voxels of {:.4} x {:.4} x {:.4} mm; each side must be 0.01 to 100 mm",
                mm[0],
                mm[1],
                mm[2]
            ));
        }
        if origin_m.amax() > 10.0 {
            return Err(invalid!(
                "its {source} puts the first voxel {:.1} m from the origin; at most 10 m is accepted",
                origin_m.amax()
            ));
        }
        let raw = Matrix3::from_columns(&[0, 1, 2].map(|a| columns_m.column(a) / spacing_m[a]));
        let worst = [(0, 1), (0, 2), (1, 2)]
            .map(|(a, b)| raw.column(a).dot(&raw.column(b)).abs())
            .into_iter()
            .fold(0.0, f64::max);
        if worst > SHEAR {
            return Err(invalid!(
                "its {source} is sheared (axes {:.2} deg off a right angle); resample it to a rectangular grid first",
                worst.min(1.0).asin().to_degrees()
            ));
        }
        Ok(Self {
            directions: nearest_orthonormal(raw),
            spacing_m,
            origin_m,
            warning: None,
        })
    }

    /// Returns the centre of a voxel of any fractional index (RAS, m).
    pub fn place_m(&self, index: [f64; 3]) -> Vector3<f64> {
        let along = Vector3::from([0, 1, 2].map(|a| index[a] * self.spacing_m[a]));
        self.directions * along + self.origin_m
    }

    /// Undoes [`VoxelFrame::place_m`].
    pub fn index_of(&self, place_m: Vector3<f64>) -> [f64; 3] {
        let along = self.directions.transpose() * (place_m - self.origin_m);
        [0, 1, 2].map(|a| along[a] / self.spacing_m[a])
    }

    /// Returns the step from voxel to voxel along each axis, one a column (RAS, m).
    pub fn columns_m(&self) -> Matrix3<f64> {
        self.directions * Matrix3::from_diagonal(&Vector3::from(self.spacing_m))
    }
}

/// Returns the nearest orthonormal matrix; single precision and rounded text leave the columns
/// slightly off.
fn nearest_orthonormal(m: Matrix3<f64>) -> Matrix3<f64> {
    let svd = m.svd(true, true);
    match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => u * v_t,
        _ => m,
    }
}
