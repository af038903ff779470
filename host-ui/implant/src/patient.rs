//! Directions of the patient in the scene.

use nalgebra::Vector3;
use stylet_shm_schema::SceneHeader;

/// Returns an axis of the patient (0 right, 2 superior) in the scene; `otherwise` if the transform
/// is not a rotation.
pub fn patient_axis(scene: &SceneHeader, axis: usize, otherwise: Vector3<f64>) -> Vector3<f64> {
    let mut in_patient = [0.0; 3];
    in_patient[axis] = 1.0;
    Vector3::from(scene.patient().scene_from_patient_direction(in_patient))
        .try_normalize(0.5)
        .filter(|d| d.iter().all(|c| c.is_finite()))
        .unwrap_or(otherwise)
}
