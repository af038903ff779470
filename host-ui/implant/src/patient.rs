//! Directions of the patient in the scene.

use nalgebra::Vector3;
use stylet_shm_schema::SceneHeader;

/// An axis of the patient (0 right, 2 superior) in the scene; `otherwise` when the transform is not one.
pub fn patient_axis(scene: &SceneHeader, axis: usize, otherwise: Vector3<f64>) -> Vector3<f64> {
    // A row of the rotation is its transpose times that axis.
    let row = Vector3::from_column_slice(&scene.patient_from_scene[3 * axis..3 * axis + 3]);
    row.try_normalize(0.5)
        .filter(|d| d.iter().all(|c| c.is_finite()))
        .unwrap_or(otherwise)
}
